// SPDX-License-Identifier: Apache-2.0
#include "render/engine.h"

#include <cstddef>
#include <utility>

#include "base/clocks.h"
#include "render/pipeline/pipeline.h"
#include "render/pipeline/validate.h"
#include "render/shading/gradients.h"
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
      : workers(&w),
        pipeline(w),
        stage(static_cast<std::size_t>(w.count())),
        inputs(w),
        gradients(w) {}

  std::size_t PixelsOf(const RenderOptions& options) const {  // of all images
    return inputs.views().size() * static_cast<std::size_t>(options.width) *
           static_cast<std::size_t>(options.height);
  }
  Status RenderStaged(const RenderOptions& options, FrameImages* frame);
  Status RenderPlain(const RenderOptions& options, FrameImages* frame);
  Status Render(std::span<const Scene> scenes, const RenderOptions& options, const Outputs& request,
                FrameImages* frame);

  // The pipeline's backward pass, with the stage if there is one.
  Status RunBackward(const RenderOptions& options, const FrameImages& frame,
                     const FrameGradients& d_frame, std::span<PipelineGradients> d_views);
  // From what that pass has summed to gradients of the scenes' arrays.
  void MergeBackward(std::span<const Scene> scenes, std::span<const SceneGradients> d_scenes);
  Status Backward(std::span<const Scene> scenes, const RenderOptions& options,
                  const FrameImages& frame, const FrameGradients& d_frame,
                  std::span<const SceneGradients> d_scenes);

  PlanReport Explain() const;

  const Workers* workers;
  Pipeline pipeline;
  ShadeStage stage;
  bool staged = false, was_backward = false;  // of the last call
  ForwardPlan forward;
  BackwardPlan backward;
  ShadeInputs inputs;
  ShadeGradients gradients;
  TextureMerge texture_merge;
  SceneSums scene_sums;
  double merge_ms = 0;
};

Status Engine::Impl::RenderStaged(const RenderOptions& options, FrameImages* frame) {
  const std::size_t pixels = PixelsOf(options);
  const Outputs& request = forward.request;
  frame->channels = forward.varyings.width(Varying::kUser);
  frame->color.resize(request.color ? 3 * pixels : 0);
  frame->normals.resize(request.normals ? 3 * pixels : 0);
  frame->uv.resize(request.uv ? 2 * pixels : 0);
  stage.BeginForward(forward, inputs.scenes(), options, frame);
  return pipeline.Render(inputs.views(), options, request, frame, &stage);
}

// Attributes are the images themselves, or there are none.
Status Engine::Impl::RenderPlain(const RenderOptions& options, FrameImages* frame) {
  Outputs request = forward.request;
  request.attributes = forward.colors_only || forward.user_only;
  // Wanted, but of a scene that has none: background.
  const std::size_t pixels = PixelsOf(options);
  frame->normals.assign(request.normals ? 3 * pixels : 0, 0.0f);
  frame->uv.assign(request.uv ? 2 * pixels : 0, 0.0f);
  if (!forward.colors_only) {
    frame->color.clear();
    return pipeline.Render(inputs.views(), options, request, frame);
  }
  frame->attributes.swap(frame->color);
  Status status = pipeline.Render(inputs.views(), options, request, frame);
  frame->attributes.swap(frame->color);
  frame->attributes.clear();
  frame->channels = 0;
  return status;
}

Status Engine::Impl::Render(std::span<const Scene> scenes, const RenderOptions& options,
                            const Outputs& request, FrameImages* frame) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateScenes(scenes));
  forward = PlanForward(parts, request);
  staged = forward.staged() && !scenes.empty();
  was_backward = false;
  merge_ms = 0;
  inputs.Begin(scenes, staged && forward.steps.texture);
  if (staged) {
    inputs.Pack(scenes, {forward.varyings, forward.varyings[Varying::kNormal]});
  } else {
    inputs.UsePlain(scenes, forward.colors_only, forward.user_only);
  }
  TILEGRAD_TRY(staged ? RenderStaged(options, frame) : RenderPlain(options, frame));
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
                              std::span<const SceneGradients> d_scenes) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateScenes(scenes));
  TILEGRAD_TRY(ValidateBackward<float>(scenes, options, d_frame, d_scenes));
  backward = PlanBackward(parts, WishesOf(d_frame, d_scenes));
  staged = backward.staged() && !scenes.empty();
  was_backward = true;
  inputs.Begin(scenes, staged && backward.steps.texture);
  if (staged) {
    const bool normals = backward.pulled[Varying::kNormal] || backward.recomputed[Varying::kNormal];
    const bool same = backward.pulled == backward.recomputed;
    inputs.Pack(scenes, {backward.pulled, normals, same ? nullptr : &backward.recomputed});
    stage.BeginBackward(backward, inputs.scenes(), options, d_frame);
  } else {
    inputs.UsePlain(scenes, backward.colors_only, backward.user_only);
  }
  const std::span<PipelineGradients> d_views = gradients.Begin(backward, inputs.views(), d_scenes);
  TILEGRAD_TRY(RunBackward(options, frame, d_frame, d_views));
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (d_scenes[n].camera != nullptr) *d_scenes[n].camera = d_views[n].d_camera;
  }
  MergeBackward(scenes, d_scenes);
  return ValidateResult(d_scenes);
}

Status Engine::Impl::RunBackward(const RenderOptions& options, const FrameImages& frame,
                                 const FrameGradients& d_frame,
                                 std::span<PipelineGradients> d_views) {
  PipelineCotangents d_images{{}, d_frame.alpha};
  if (backward.colors_only) d_images.attributes = d_frame.color;
  if (backward.user_only) d_images.attributes = d_frame.attributes;
  Status status = pipeline.Backward(inputs.views(), options, frame, d_images, d_views,
                                    staged ? &stage : nullptr);
  // Cotangents that pull nothing have been looked at by nobody.
  const bool unseen = !staged && !backward.colors_only && !backward.user_only;
  if (!status.ok() || unseen || (staged && !stage.sound())) {
    TILEGRAD_TRY(ValidateCotangents(d_frame, frame.face_ids));
  }
  return status;
}

void Engine::Impl::MergeBackward(std::span<const Scene> scenes,
                                 std::span<const SceneGradients> d_scenes) {
  StageClock clock;
  ClearUniforms(d_scenes);
  if (staged) MergeUniforms(stage, inputs.scenes(), d_scenes, &scene_sums);
  if (staged && backward.to_texture) {
    texture_merge.Run(stage, inputs.scenes(), *workers, d_scenes);
  } else {
    ClearTextures(d_scenes);
  }
  gradients.Merge(backward, inputs, scenes, d_scenes);
  clock.Lap(&merge_ms);
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
                        std::span<const SceneGradients> d_scenes) {
  return impl_->Backward(scenes, options, frame, d_frame, d_scenes);
}

PlanReport Engine::Explain() const { return impl_->Explain(); }

}  // namespace tilegrad
