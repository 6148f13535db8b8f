// SPDX-License-Identifier: Apache-2.0
// The differentiable renderer: scenes in, images out; gradients of images in, gradients of scenes
// out (paper, section 3).
//
// A batch of N scenes, each with its own mesh and camera, is rendered to N images of one size.
// Foreground pixels interpolate the attributes of the nearest face (equation 1); alpha is made by a
// rule (SoftRule; the default is equation 6 over all faces, within `max_alpha_error`, for
// background pixels). The backward pass is
// analytic and needs only the Frame: face ids and alpha, and goes faster with its transmittance.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "raster/attributes.h"
#include "scene/camera.h"
#include "tilegrad/status.h"

namespace tilegrad {

enum class FaceCulling {
  kNone,
  kBack,  // clockwise faces are not drawn, but take part in alpha
};
// Views over arrays of the caller, who keeps them alive and unchanged until Backward.
template <class T>
struct SceneViewT {
  std::span<const T> positions;         // [V,3] world
  std::span<const std::int32_t> faces;  // [F,3] indices in [0, V)
  std::span<const T> attributes;        // [V,C] or [F,3,C] by `rate`; empty if channels == 0
  int channels = 0;                     // C >= 0
  AttributeRate rate = AttributeRate::kVertex;
  CameraT<T> camera;
};

// How alpha is made: render/alpha/ has a stage for each.
enum class SoftRule {
  kAllFaces,  // equation 6 over all faces, within max_alpha_error
  kPaper      // as the paper's implementations: no bound, depends on the order of the faces, slow.
              // For comparisons with them.
};
// Of SoftRule::kPaper.
struct PaperSoftRule {
  double box = 0.02;   // NDC, >= 0: a face counts where its box, grown by this, holds the pixel
  int max_faces = 30;  // >= 0: only the first so many count, in the order of the faces

  bool operator==(const PaperSoftRule&) const = default;
};
struct RenderOptions {
  int width = 64, height = 64;  // pixels, 1..16384
  // Equation 5: A = exp(-d^2 / delta), with d in NDC, in which the image spans [-1, 1] in each
  // axis; > 0.
  double delta = 1.0 / 7000;
  // |alpha - equation 6 over all faces| <= this, in [0, 1]; 0 drops nothing.
  double max_alpha_error = 1e-6;
  Interpolation interpolation = Interpolation::kPerspective;
  FaceCulling culling = FaceCulling::kNone;
  SoftRule soft_rule = SoftRule::kAllFaces;
  PaperSoftRule paper;  // with SoftRule::kPaper, which has no use for max_alpha_error

  bool operator==(const RenderOptions&) const = default;
};

// Which images are wanted. What is not wanted is not computed and takes no memory.
struct RenderRequest {
  bool attributes = true;
  bool alpha = true;
  bool depth = false;
  bool barycentrics = false;  // perspective-correct or screen-linear, as the options say
};

// The images of a batch, planar: N images, row 0 on top. Reused between calls of one size without
// allocation.
template <class T>
struct FrameT {
  int images = 0, channels = 0, height = 0, width = 0;
  // [N,H,W] index into the scene's faces, -1 at background pixels; always there
  AlignedVector<std::int32_t> face_ids;
  AlignedVector<T> attributes;  // [N,C,H,W]; 0 at background pixels
  AlignedVector<T> alpha;       // [N,H,W]; exactly 1 at foreground pixels
  AlignedVector<T> depth;       // [N,H,W]; +infinity at background pixels
  // [N,2,H,W] weights of corners 1 and 2 (corner 0 has the rest); 0 at background pixels
  AlignedVector<T> barycentrics;
  // [N, H W] 1 - alpha with more digits, where Backward has use for it, in the order of
  // raster/soft_mask/soft_mask.h, SoftMaskImages; the rest is unspecified. May be emptied: Backward
  // then takes more time.
  AlignedVector<T> transmittance;
  double alpha_error_bound = 0;  // what culling really spent: no pixel is farther than this from
                                 // equation 6; infinite with SoftRule::kPaper
};

// dL/d(image); an empty span is zero. Shapes as in Frame.
template <class T>
struct FrameGradientsT {
  std::span<const T> attributes;
  std::span<const T> alpha;
};

// dL/d(scene), overwritten. An empty span (or false) is not computed.
template <class T>
struct SceneGradientsT {
  std::span<T> positions;   // [V,3]
  std::span<T> attributes;  // as SceneView::attributes
  bool camera = false;      // fill d_camera
  CameraT<T> d_camera;      // entry-wise: dL/d(rotation[i]), ..., as if all entries were free;
                            // near_plane gets 0
};

using SceneView = SceneViewT<float>;
using Frame = FrameT<float>;
using FrameGradients = FrameGradientsT<float>;
using SceneGradients = SceneGradientsT<float>;

// What a call of Render or Backward did. Parts: bins of an image where it is drawn or given alpha,
// bands of it on the way back through attributes.
struct RenderStats {
  std::int64_t prepared = 0;  // images projected and listed; others were as they had been before
  std::int64_t drawn = 0;     // parts
  std::int64_t interpolated = 0;  // parts, forward or backward
  std::int64_t alpha_parts = 0;   // parts, forward or backward
  std::int64_t merged = 0;        // arrays of gradients: positions and attributes count apart
  // Of the soft mask, forward or backward, lanes of vectors that had no face included. They depend
  // on the instruction set.
  std::int64_t pairs = 0;   // of a face and a background pixel that were evaluated
  std::int64_t powers = 0;  // exponentials
};

// Milliseconds in the stages of a call, summed over workers.
struct RenderTimes {
  double prepare = 0;      // project, bin, and the hierarchy of the soft mask
  double visibility = 0;   // which face a pixel shows, and depth
  double interpolate = 0;  // attributes of pixels, forward or backward
  double stage = 0;        // a PixelStage
  double gradients = 0;    // from attributes of pixels to faces
  double alpha = 0;        // the rule of alpha, forward or backward
  double merge = 0;        // from faces to the scene
};

class PixelStage;  // pixel_stage.h

// Owns scratch memory, which is reused: rendering the same sizes again allocates nothing. One call
// at a time per Renderer. Same bits for any worker count and any run. All scenes of a batch have
// the same number of channels.
class Renderer {
 public:
  explicit Renderer(const Workers& workers);  // keeps a reference
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  // Errors: a span of the wrong size (names scene, array, expected and got), an index out of range,
  // a non-finite input (names scene, array, index), options out of range. Then `frame` is left
  // unspecified.
  // With a stage, `attributes` of the scenes are its input, and it writes frame->attributes, whose
  // `channels` the caller has set.
  Status Render(std::span<const SceneView> scenes, const RenderOptions& options,
                const RenderRequest& request, Frame* frame, PixelStage* stage = nullptr);

  // `scenes`, `options` and `frame` as they were given to and filled by Render; `frame` needs alpha
  // where d_frame has it. A gradient that overflows float is an error too; after an error d_scenes
  // may be written in part.
  // With a stage, the cotangents of `attributes` come from it, and d_frame.attributes is empty.
  Status Backward(std::span<const SceneView> scenes, const RenderOptions& options,
                  const Frame& frame, const FrameGradients& d_frame,
                  std::span<SceneGradients> d_scenes, PixelStage* stage = nullptr);

  RenderStats stats() const;  // of the last call
  RenderTimes times() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad
