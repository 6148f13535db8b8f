// SPDX-License-Identifier: Apache-2.0
// What is behind a Renderer of floats: scenes and images of the public interface, checked, planned
// (render/shading/plan.h) and handed to the pipeline and its shade stage. What a scene does not
// have and the caller does not ask for is not computed.
#pragma once

#include <span>

#include "base/parallel.h"
#include "render/frame_images.h"
#include "render/gradient_targets.h"
#include "render/pipeline/pipeline.h"
#include "render/shading/inputs.h"
#include "render/shading/plan.h"
#include "render/shading/stage.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Owns scratch memory, which is reused: rendering the same sizes again allocates nothing. One call
// at a time. Same bits for any worker count and any run.
class Engine {
 public:
  explicit Engine(const Workers& workers);  // keeps a reference

  // As RendererT::Render. After an error `frame` is left unspecified.
  Status Render(std::span<const Scene> scenes, const RenderOptions& options, const Outputs& outputs,
                FrameImages* frame);

  // `scenes`, `options` and `frame` as they were given to and filled by Render; of the frame, face
  // ids are read, and alpha where d_frame has it. Overwrites what the targets have listed, arrays
  // and scenes' own records; after an error that may be done in part.
  Status Backward(std::span<const Scene> scenes, const RenderOptions& options,
                  const FrameImages& frame, const FrameGradients& d_frame,
                  GradientTargets<float>* targets);

  PlanReport Explain() const;  // the last call

 private:
  // Streams for the pipeline: side by side for the stage, or as they are.
  Status SetInputs(std::span<const Scene> scenes, const StreamSets& sets, bool colors_only,
                   bool user_only);
  // The pipeline's backward pass, with the stage if there is one. False: a number is not finite.
  bool RunBackward(const RenderOptions& options, const FrameImages& frame,
                   const FrameGradients& d_frame, std::span<PipelineGradients> d_views);

  const Workers* workers_;
  Pipeline pipeline_;
  ShadeStage stage_;
  bool staged_ = false, was_backward_ = false;  // of the last call
  ForwardPlan forward_;
  BackwardPlan backward_;
  ShadeInputs inputs_;
  GradientMerge merge_;
  double merge_ms_ = 0;
};

// The same calls in double, of the naive renderer (render/reference.h). Images are its units of
// work; memory is allocated by every call.
class ReferenceRenderer {
 public:
  explicit ReferenceRenderer(const Workers& workers) : workers_(&workers) {}  // keeps a reference

  Status Render(std::span<const SceneT<double>> scenes, const RenderOptions& options,
                const Outputs& outputs, FrameImagesT<double>* frame);
  Status Backward(std::span<const SceneT<double>> scenes, const RenderOptions& options,
                  const FrameImagesT<double>& frame, const FrameGradientsT<double>& d_frame,
                  GradientTargets<double>* targets);

 private:
  const Workers* workers_;
};

}  // namespace tilegrad
