// SPDX-License-Identifier: Apache-2.0
// Renders meshes to images of interpolated attributes, and back-propagates (paper, section 3).
//
// A batch of N scenes, each with its own mesh and camera, is rendered to N images of one size.
// Foreground pixels interpolate the attributes of the nearest face (equation 1); a rule computes
// alpha (AlphaRule; by default equation 6 over all faces, within `max_alpha_error`). The backward
// pass is analytic and needs only the frame: face ids, alpha and its transmittance.
#pragma once

#include <memory>
#include <span>

#include "base/aligned.h"
#include "base/parallel.h"
#include "render/frame_images.h"
#include "render/pipeline/records.h"

namespace tilegrad {

class PixelStage;

// Owns scratch memory and reuses it: rendering the same sizes again allocates nothing. One call at
// a time per Pipeline. Same bits for any worker count and any run. All scenes of a batch have the
// same number of channels. Inputs must be valid (render/validate.h).
class Pipeline {
 public:
  explicit Pipeline(const Workers& workers);  // keeps a reference
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  // The destination of interpolated attributes: an image of the frame, resized to fit; a stage,
  // which writes its own images; or, both null, none.
  struct Attributes {
    AlignedVector<float>* image = nullptr;
    PixelStage* stage = nullptr;
  };

  // Fills face_ids and, if `frame` has room for them (SizeFrame), depth, barycentrics and alpha.
  void Render(std::span<const PipelineScene> scenes, const RenderOptions& options,
              const Attributes& attributes, FrameImages* frame);

  // `scenes`, `options` and `frame` as passed to and filled by Render; `frame` has alpha if d_frame
  // has it. A stage computes the cotangents of attributes itself, and d_frame.attributes is empty.
  // Returns false, possibly with partly written gradients, if a cotangent or a gradient is not
  // finite.
  [[nodiscard]] bool Backward(std::span<const PipelineScene> scenes, const RenderOptions& options,
                              const FrameImages& frame, const PipelineCotangents& d_frame,
                              std::span<PipelineGradients> d_scenes, PixelStage* stage = nullptr);

  RenderStats stats() const;  // of the last call
  RenderTimes times() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad
