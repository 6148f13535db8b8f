// SPDX-License-Identifier: Apache-2.0
// What is behind a Renderer of floats: scenes and images of the public interface, checked, planned
// (render/shading/plan.h) and handed to the pipeline and its shade stage. What a scene does not
// have and the caller does not ask for is not computed.
#pragma once

#include <memory>
#include <span>

#include "base/parallel.h"
#include "render/frame_images.h"
#include "render/shading/plan.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Owns scratch memory, which is reused: rendering the same sizes again allocates nothing. One call
// at a time. Same bits for any worker count and any run.
class Engine {
 public:
  explicit Engine(const Workers& workers);  // keeps a reference
  ~Engine();
  Engine(Engine&&) noexcept;
  Engine& operator=(Engine&&) noexcept;

  // As RendererT::Render. After an error `frame` is left unspecified.
  Status Render(std::span<const Scene> scenes, const RenderOptions& options, const Outputs& outputs,
                FrameImages* frame);

  // `scenes`, `options` and `frame` as they were given to and filled by Render; of the frame, face
  // ids are read, and alpha where d_frame has it. Gradients are overwritten, and after an error may
  // be written in part. Scenes may share them, but for cameras.
  Status Backward(std::span<const Scene> scenes, const RenderOptions& options,
                  const FrameImages& frame, const FrameGradients& d_frame,
                  std::span<const SceneGradients> d_scenes);

  PlanReport Explain() const;  // the last call

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad
