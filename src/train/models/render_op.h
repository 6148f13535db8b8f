// SPDX-License-Identifier: Apache-2.0
// The renderer as an operation on the tape: scenes of tensors in, images out, gradients back.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "render/renderer.h"
#include "rivals/renderer.h"
#include "scene/camera.h"

namespace tilegrad::train {

// The scenes of a batch: B meshes of V vertices, each seen by `views` cameras, N = B * views
// images. An invalid Var is absent. Computes only the gradients that are needed.
struct SceneVars {
  nn::Var positions{};         // [B,V,3]
  nn::Var colors{};            // [B,V,3]
  nn::Var textures{};          // [B,h,w,3], one for each mesh, looked up at RenderJob::uvs
  nn::Var light_directions{};  // [N,3] from the surface to the light, of any length > 0: one for
                               // each image, for Lighting::kLambert and kPhong
  nn::Var shininess{};         // [N]; Lighting::kPhong
  nn::Var sh{};                // [N,9]; Lighting::kSphericalHarmonics
  nn::Var cameras{};           // [N,16] rotation, translation, fx, fy, cx, cy: instead of
                               // RenderJob's, whose near planes are kept
  nn::Var uvs{};               // [F,3,2], of all meshes: instead of RenderJob's
  nn::Var reflectance{};       // [N,9] ambient, diffuse, specular: instead of RenderJob::surface's
};

// Calls visit with the numbers of a camera in the order of a row of SceneVars::cameras.
inline constexpr std::int64_t kCameraNumbers = 16;
template <class Camera, class Visit>
void ForEachCameraNumber(Camera&& camera, const Visit& visit) {
  for (auto& number : camera.rotation) visit(number);
  for (auto& number : camera.translation) visit(number);
  visit(camera.fx);
  visit(camera.fy);
  visit(camera.cx);
  visit(camera.cy);
}

// The inputs other than tensors, the same for all meshes.
struct RenderJob {
  std::span<const std::int32_t> faces{};  // [F,3]; must outlive the tape
  std::vector<Camera> cameras;            // [N]: mesh b has cameras [b * views, (b + 1) * views)
  int views = 1;
  RenderOptions options{};
  bool alpha = true;
  bool normals = false;  // also draw normals, into the renderer's frame (FrameOf)
  // [F,3,2] of corners, with SceneVars::textures and without its uvs.
  std::span<const float> uvs{};
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kBilinear;
  ShadingModel shading{};
  Surface surface{};  // of all faces; its texture is SceneVars::textures, if given
};

struct RenderedImages {
  nn::Var colors;  // [N, 3, H, W], 0 at background pixels
  nn::Var alpha;   // [N, H, W]; invalid without RenderJob::alpha
};

// A renderer with its images, reused from step to step so that a steady state allocates nothing
// large. Holds the state of one rendering at a time: run or drop its backward pass before the next
// RenderScenes.
struct SceneRenderer {
  explicit SceneRenderer(const Workers& workers)
      : renderer(RendererOn(workers)), renderer64(RendererOn<double>(workers)) {}
  Renderer renderer;
  RendererT<double> renderer64;
  Frame frame;
  FrameT<double> frame64;
};

inline Frame& FrameOf(SceneRenderer& r, float) { return r.frame; }
inline FrameT<double>& FrameOf(SceneRenderer& r, double) { return r.frame64; }

// All tensors are of one type; f64 renders with the scalar reference (for proofs). Errors of shapes
// and of the renderer reach the context's status. One call of `renderer` at a time, backward
// included.
RenderedImages RenderScenes(SceneRenderer& renderer, const SceneVars& scenes, RenderJob job);

// The rivals' renderers (src/rivals) as an operation on the tape: meshes in, images out, the rule's
// own gradient back.

// The inputs that all meshes of a batch share.
struct RivalJob {
  std::span<const std::int32_t> faces{};  // [F,3]; must outlive the tape
  std::vector<Camera>
      cameras;   // [N], N = B * views: mesh b has cameras [b * views, (b + 1) * views)
  int size = 0;  // pixels a side of the images
  rivals::Options options{};
};

// Reused from step to step. Holds the state of one rendering at a time, as SceneRenderer does
// (render_op.h).
struct RivalRenderer {
  explicit RivalRenderer(const Workers& workers) : renderer(workers), renderer64(workers) {}
  rivals::RendererT<float> renderer;
  rivals::RendererT<double> renderer64;
};

// textures: [B,F,texels,3], cubes of N3MR's faces, with Options::n3mr_colors. Otherwise as below.
RenderedImages RenderTextured(RivalRenderer& renderer, const nn::Var& positions,
                              const nn::Var& textures, RivalJob job);

// positions, and colors of vertices: [B,V,3]. An invalid `colors` draws only alpha: the images'
// colors are then invalid, too. f64 draws SoftRas with the scalar reference (for proofs). Errors of
// shapes and options reach the context's status.
RenderedImages RenderRival(RivalRenderer& renderer, const nn::Var& positions, const nn::Var& colors,
                           RivalJob job);

}  // namespace tilegrad::train
