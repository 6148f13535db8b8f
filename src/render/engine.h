// SPDX-License-Identifier: Apache-2.0
// The implementation of a Renderer of floats: validates and plans (render/shading/plan.h) calls of
// the public interface and runs the pipeline with its shade stage. Computes only what the scene has
// and the caller requests.
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

// Owns scratch memory and reuses it: rendering the same sizes again allocates nothing. One call at
// a time. Same bits for any worker count and any run.
class Engine {
 public:
  explicit Engine(const Workers& workers);  // keeps a reference

  // Like RendererT::Render. After an error the contents of `frame` are unspecified.
  Status Render(std::span<const Scene> scenes, const RenderOptions& options, const Outputs& outputs,
                FrameImages* frame);

  // `scenes`, `options` and `frame` as passed to and filled by Render; reads the frame's face ids,
  // and alpha if d_frame has it. Overwrites the arrays and per-scene records listed in the targets,
  // possibly only in part after an error.
  Status Backward(std::span<const Scene> scenes, const RenderOptions& options,
                  const FrameImages& frame, const FrameGradients& d_frame,
                  GradientTargets<float>* targets);

  PlanReport Explain() const;  // of the last call

 private:
  // Sets the pipeline's streams: packed for the stage, or unpacked.
  Status SetInputs(std::span<const Scene> scenes, const StreamSets& sets, bool colors_only,
                   bool user_only);
  // The pipeline's backward pass, with the stage if there is one. False if a number is not finite.
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

// The same interface in double, on the naive renderer (render/reference.h). Parallel over images;
// every call allocates memory.
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
