// SPDX-License-Identifier: Apache-2.0
// One picture of a scene for viewing: anti-aliased colour and alpha, and the other images at pixel
// centres. Not differentiable.
#pragma once

#include <vector>

#include "render/picture/layers.h"
#include "render/picture/mesh_scene.h"
#include "render/renderer.h"

namespace tilegrad {

struct PictureRequest {
  int width = 0, height = 0;  // pixels
  // Colour and alpha are rendered at this many times the size, one sample per pixel, and averaged
  // over squares; >= 1, and size times this at most 16384.
  int supersampling = 1;
  bool color = true;
  bool alpha = false;  // without colour; colour implies it
  bool depth = false, normals = false, uv = false, face_ids = false;  // at pixel centres
  double soft_delta = 0;  // > 0: alpha is equation 6 with this delta (RenderOptions) instead of
                          // coverage
  FaceCulling culling = FaceCulling::kNone;
  // Cut-outs and transparency of the scene's surfaces; null: none. A soft alpha ignores them: all
  // surfaces are opaque. The images at pixel centres show the nearest face that is not cut out.
  const SceneCover* cover = nullptr;
};

// Planar like a Frame; images that were not requested are empty.
struct Picture {
  int width = 0, height = 0;
  std::vector<float> color;    // [3,H,W] in the scene's colour space, clamped to [0, 1], the mean
                               // over the covered part of a pixel; 0 at background pixels
  std::vector<float> alpha;    // [H,W] coverage, or soft
  std::vector<float> depth;    // [H,W] +infinity at background pixels
  std::vector<float> normals;  // [3,H,W] unit, world
  std::vector<float> uv;       // [2,H,W]
  std::vector<std::int32_t> face_ids;  // [H,W] -1 at background pixels
  std::vector<PlanReport> plans;       // of each pass: colour and alpha, then the other images
};

// The only supersampler: averages colour and alpha of image 0 of `samples` over squares of scale x
// scale samples. Uses the alpha of the samples if they have it, else coverage.
void AverageSamples(const Images& samples, int scale, Picture* picture);

class PictureRenderer {
 public:
  explicit PictureRenderer(const Workers& workers)
      : renderer_(RendererOn(workers)), layers_(workers) {}

  // `scene.camera` is for the picture's size. Errors: those of Renderer::Render, and a request out
  // of range.
  Status Render(const Scene& scene, const PictureRequest& request, Picture* picture);

 private:
  Status RenderColor(Scene scene, const PictureRequest& request, Picture* picture);
  Status RenderExact(const Scene& scene, const PictureRequest& request, Picture* picture);

  Status RenderColorLayers(const Scene& scene, const PictureRequest& request, Picture* picture);
  Status RenderExactLayers(const Scene& scene, const PictureRequest& request, const Outputs& images,
                           Picture* picture);
  void AverageLayers(const PictureRequest& request, Picture* picture) const;

  Renderer renderer_;
  Frame frame_;
  LayerRenderer layers_;
  std::vector<float> seen_;     // [3,H,W] composited over all layers
  std::vector<float> through_;  // [H,W] fraction visible through the layers so far
};

}  // namespace tilegrad
