// SPDX-License-Identifier: Apache-2.0
// Meshes in, images of what is interpolated over them out, and back (paper, section 3).
//
// A batch of N scenes, each with its own mesh and camera, is rendered to N images of one size.
// Foreground pixels interpolate the attributes of the nearest face (equation 1); alpha is made by a
// rule (AlphaRule; by default equation 6 over all faces, within `max_alpha_error`). The backward
// pass is analytic and needs only the frame: face ids and alpha, and goes faster with its
// transmittance.
#pragma once

#include <memory>
#include <span>

#include "base/parallel.h"
#include "render/pipeline/records.h"
#include "render/pipeline/work.h"
#include "tilegrad/status.h"

namespace tilegrad {

class PixelStage;  // pixel_stage.h

// Owns scratch memory, which is reused: rendering the same sizes again allocates nothing. One call
// at a time per Renderer. Same bits for any worker count and any run. All scenes of a batch have
// the same number of channels.
class Pipeline {
 public:
  explicit Pipeline(const Workers& workers);  // keeps a reference
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  // Errors: a span of the wrong size (names scene, array, expected and got), an index out of range,
  // a non-finite input (names scene, array, index), options out of range. Then `frame` is left
  // unspecified.
  // With a stage, `attributes` of the scenes are its input, and it writes frame->attributes, whose
  // `channels` the caller has set.
  Status Render(std::span<const PipelineScene> scenes, const RenderOptions& options,
                const Outputs& request, PipelineFrame* frame, PixelStage* stage = nullptr);

  // `scenes`, `options` and `frame` as they were given to and filled by Render; `frame` needs alpha
  // where d_frame has it. A gradient that overflows float is an error too; after an error d_scenes
  // may be written in part.
  // With a stage, the cotangents of `attributes` come from it, and d_frame.attributes is empty.
  Status Backward(std::span<const PipelineScene> scenes, const RenderOptions& options,
                  const PipelineFrame& frame, const PipelineCotangents& d_frame,
                  std::span<PipelineGradients> d_scenes, PixelStage* stage = nullptr);

  RenderStats stats() const;  // of the last call
  RenderTimes times() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad
