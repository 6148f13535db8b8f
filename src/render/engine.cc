// SPDX-License-Identifier: Apache-2.0
#include "render/engine.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "base/clocks.h"
#include "base/error.h"
#include "render/checks.h"
#include "render/pipeline/pipeline.h"
#include "render/shading/inputs.h"
#include "render/shading/merge.h"
#include "render/shading/report.h"
#include "render/shading/stage.h"
#include "render/validate.h"

namespace tilegrad {
namespace {

GradientWishes WishesOf(const FrameGradients& d_frame, std::span<const SceneGradients> d_scenes) {
  GradientWishes w;
  w.d_color = !d_frame.color.empty();
  w.d_normals = !d_frame.normals.empty();
  w.d_uv = !d_frame.uv.empty();
  w.d_depth = !d_frame.depth.empty();
  w.d_user = !d_frame.attributes.empty();
  w.d_alpha = !d_frame.alpha.empty();
  for (const SceneGradients& d : d_scenes) {
    ForEachStream(Scene(), d, [&](const SceneStream<float>& stream) {
      w.streams[static_cast<std::size_t>(stream.what)] |= !stream.gradient.empty();
    });
    w.camera |= d.camera != nullptr;
    w.surfaces |= !d.surfaces.empty();
    w.lights |= !d.lights.empty();
    w.sh |= !d.sh.empty();
    for (const auto& texture : d.textures) w.textures |= !texture.empty();
  }
  return w;
}

}  // namespace

struct Engine::Impl {
  explicit Impl(const Workers& w)
      : workers(&w), pipeline(w), stage(static_cast<std::size_t>(w.count())), inputs(w), merge(w) {}

  // Streams for the pipeline: side by side for the stage, or as they are.
  Status SetInputs(std::span<const Scene> scenes, const StreamSets& sets, bool colors_only,
                   bool user_only);
  Status Render(std::span<const Scene> scenes, const RenderOptions& options, const Outputs& request,
                FrameImages* frame);

  // The pipeline's backward pass, with the stage if there is one. False: a number is not finite.
  bool RunBackward(const RenderOptions& options, const FrameImages& frame,
                   const FrameGradients& d_frame, std::span<PipelineGradients> d_views);
  Status Backward(std::span<const Scene> scenes, const RenderOptions& options,
                  const FrameImages& frame, const FrameGradients& d_frame,
                  const GradientTargets<float>& targets);

  PlanReport Explain() const;

  const Workers* workers;
  Pipeline pipeline;
  ShadeStage stage;
  bool staged = false, was_backward = false;  // of the last call
  ForwardPlan forward;
  BackwardPlan backward;
  ShadeInputs inputs;
  GradientMerge merge;
  double merge_ms = 0;
};

Status Engine::Impl::SetInputs(std::span<const Scene> scenes, const StreamSets& sets,
                               bool colors_only, bool user_only) {
  if (staged) return inputs.Pack(scenes, sets);
  inputs.UsePlain(scenes, colors_only, user_only);
  return {};
}

Status Engine::Impl::Render(std::span<const Scene> scenes, const RenderOptions& options,
                            const Outputs& request, FrameImages* frame) {
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateScenes(scenes, options, *workers));
  forward = PlanForward(parts, request);
  staged = forward.staged() && !scenes.empty();
  was_backward = false;
  merge_ms = 0;
  inputs.Begin(scenes, staged && forward.steps.texture);
  TILEGRAD_TRY(SetInputs(scenes, {forward.varyings, forward.varyings[Varying::kNormal]},
                         forward.colors_only, forward.user_only));
  SizeFrame(scenes.size(), parts.user_channels, options, request, frame);
  Pipeline::Attributes attributes;
  if (staged) {
    stage.BeginForward(forward, inputs.scenes(), options, frame);
    attributes.stage = &stage;
  } else {
    std::fill(frame->uv.begin(), frame->uv.end(), 0.0f);  // wanted, but of a scene that has none
    if (forward.colors_only) attributes.image = &frame->color;
    if (forward.user_only) attributes.image = &frame->attributes;
  }
  pipeline.Render(inputs.views(), options, attributes, frame);
  return parts.may_overflow ? ValidateImages(*frame) : Status();
}

PlanReport Engine::Impl::Explain() const {
  CallWork call{pipeline.stats(), pipeline.times(), staged ? stage.work() : ShadeWork(),
                inputs.work()};
  call.scene.merge_ms = merge_ms;
  return was_backward ? ReportBackward(backward, call) : ReportForward(forward, call);
}

Status Engine::Impl::Backward(std::span<const Scene> scenes, const RenderOptions& options,
                              const FrameImages& frame, const FrameGradients& d_frame,
                              const GradientTargets<float>& targets) {
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateScenes(scenes, options, *workers));
  TILEGRAD_TRY(ValidateBackward<float>(scenes, options, frame, d_frame, targets.scenes()));
  backward = PlanBackward(parts, WishesOf(d_frame, targets.scenes()));
  staged = backward.staged() && !scenes.empty();
  was_backward = true;
  inputs.Begin(scenes, staged && backward.steps.texture);
  const bool normals = backward.pulled[Varying::kNormal] || backward.recomputed[Varying::kNormal];
  const bool same = backward.pulled == backward.recomputed;
  TILEGRAD_TRY(SetInputs(scenes, {backward.pulled, normals, same ? nullptr : &backward.recomputed},
                         backward.colors_only, backward.user_only));
  if (staged) stage.BeginBackward(backward, inputs.scenes(), options, d_frame);
  const bool sound =
      RunBackward(options, frame, d_frame, merge.Begin(backward, inputs.views(), targets));
  if (!sound) {
    TILEGRAD_TRY(CheckNumbers("d_frame.alpha", d_frame.alpha));
    TILEGRAD_TRY(ValidateCotangents(d_frame, frame.face_ids));
  }
  StageClock clock;
  merge.Run({backward, inputs, staged ? &stage : nullptr, targets});
  clock.Lap(&merge_ms);
  TILEGRAD_TRY(targets.CheckSums());
  return sound ? Status() : InvalidArgument("the gradient overflows");  // one that nobody wants
}

bool Engine::Impl::RunBackward(const RenderOptions& options, const FrameImages& frame,
                               const FrameGradients& d_frame,
                               std::span<PipelineGradients> d_views) {
  PipelineCotangents d_images{{}, d_frame.alpha};
  if (backward.colors_only) d_images.attributes = d_frame.color;
  if (backward.user_only) d_images.attributes = d_frame.attributes;
  const bool sound = pipeline.Backward(inputs.views(), options, frame, d_images, d_views,
                                       staged ? &stage : nullptr);
  if (staged) return sound && stage.sound();
  // Cotangents that pull nothing have been looked at by nobody.
  const bool seen = backward.colors_only || backward.user_only;
  return sound && (seen || ValidateCotangents(d_frame, frame.face_ids).ok());
}

Engine::Engine(const Workers& workers) : impl_(std::make_unique<Impl>(workers)) {}
Engine::~Engine() = default;
Engine::Engine(Engine&&) noexcept = default;
Engine& Engine::operator=(Engine&&) noexcept = default;

Status Engine::Render(std::span<const Scene> scenes, const RenderOptions& options,
                      const Outputs& request, FrameImages* frame) {
  return impl_->Render(scenes, options, request, frame);
}

Status Engine::Backward(std::span<const Scene> scenes, const RenderOptions& options,
                        const FrameImages& frame, const FrameGradients& d_frame,
                        GradientTargets<float>* targets) {
  return impl_->Backward(scenes, options, frame, d_frame, *targets);
}

PlanReport Engine::Explain() const { return impl_->Explain(); }

}  // namespace tilegrad
