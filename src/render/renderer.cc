// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <cstddef>
#include <utility>

#include "base/stage_clock.h"
#include "render/pipeline/validate.h"
#include "render/shading/gradients.h"
#include "render/shading/inputs.h"
#include "render/shading/merge.h"
#include "render/shading/report.h"
#include "render/shading/stage.h"
#include "render/shading/validate.h"

namespace tilegrad {
namespace {

GradientWishes WishesOf(const ShadedFrameGradients& d_frame,
                        std::span<const ShadedGradients> d_scenes) {
  GradientWishes w;
  w.d_color = !d_frame.color.empty(), w.d_normals = !d_frame.normals.empty();
  w.d_uv = !d_frame.uv.empty(), w.d_depth = !d_frame.depth.empty();
  w.d_user = !d_frame.attributes.empty(), w.d_alpha = !d_frame.alpha.empty();
  for (const ShadedGradients& d : d_scenes) {
    w.positions |= !d.positions.empty(), w.camera |= d.camera;
    w.colors |= !d.colors.empty(), w.uvs |= !d.uvs.empty(), w.normals |= !d.normals.empty();
    w.light_directions |= !d.light_directions.empty(), w.user |= !d.attributes.empty();
    w.surfaces |= !d.surfaces.empty(), w.lights |= !d.lights.empty(), w.sh |= !d.sh.empty();
    for (const auto& texture : d.textures) w.textures |= !texture.empty();
  }
  return w;
}

}  // namespace

struct ShadedRenderer::Impl {
  explicit Impl(const Workers& w)
      : workers(&w),
        renderer(w),
        stage(static_cast<std::size_t>(w.count())),
        inputs(w),
        gradients(w) {}

  Status RenderStaged(const RenderOptions& options, ShadedFrame* frame);
  Status RenderPlain(const RenderOptions& options, ShadedFrame* frame);
  Status Render(std::span<const ShadedScene> scenes, const RenderOptions& options,
                const ShadedRequest& request, ShadedFrame* frame);

  // The renderer's own backward pass, with the stage if there is one.
  Status RunBackward(const RenderOptions& options, const ShadedFrame& frame,
                     const ShadedFrameGradients& d_frame, std::span<SceneGradients> d_views);
  // From what that pass has summed to gradients of the scenes' arrays.
  void MergeBackward(std::span<const ShadedScene> scenes, std::span<ShadedGradients> d_scenes);
  Status Backward(std::span<const ShadedScene> scenes, const RenderOptions& options,
                  const ShadedFrame& frame, const ShadedFrameGradients& d_frame,
                  std::span<ShadedGradients> d_scenes);

  PlanReport Explain() const;

  const Workers* workers;
  Renderer renderer;
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

Status ShadedRenderer::Impl::RenderStaged(const RenderOptions& options, ShadedFrame* frame) {
  const std::size_t pixels = inputs.views().size() * static_cast<std::size_t>(options.width) *
                             static_cast<std::size_t>(options.height);
  const ShadedRequest& request = forward.request;
  frame->channels = forward.varyings.width(Varying::kUser);
  frame->color.resize(request.color ? 3 * pixels : 0);
  frame->normals.resize(request.normals ? 3 * pixels : 0);
  frame->uv.resize(request.uv ? 2 * pixels : 0);
  stage.BeginForward(forward, inputs.scenes(), options, frame);
  return renderer.Render(inputs.views(), options, request, frame, &stage);
}

// Attributes are the images themselves, or there are none.
Status ShadedRenderer::Impl::RenderPlain(const RenderOptions& options, ShadedFrame* frame) {
  RenderRequest request = forward.request;
  request.attributes = forward.colors_only || forward.user_only;
  frame->normals.clear(), frame->uv.clear();
  if (!forward.colors_only) {
    frame->color.clear();
    return renderer.Render(inputs.views(), options, request, frame);
  }
  frame->attributes.swap(frame->color);
  const Status status = renderer.Render(inputs.views(), options, request, frame);
  frame->attributes.swap(frame->color);
  frame->attributes.clear();
  frame->channels = 0;
  return status;
}

Status ShadedRenderer::Impl::Render(std::span<const ShadedScene> scenes,
                                    const RenderOptions& options, const ShadedRequest& request,
                                    ShadedFrame* frame) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateShadedScenes(scenes));
  forward = PlanForward(parts, request);
  staged = forward.staged() && !scenes.empty(), was_backward = false, merge_ms = 0;
  inputs.Begin(scenes, staged && forward.steps.texture);
  if (staged) {
    inputs.Pack(scenes, {forward.varyings, forward.varyings[Varying::kNormal]});
  } else {
    inputs.UsePlain(scenes, forward.colors_only, forward.user_only);
  }
  return staged ? RenderStaged(options, frame) : RenderPlain(options, frame);
}

PlanReport ShadedRenderer::Impl::Explain() const {
  CallWork call{renderer.stats(), renderer.times(), staged ? stage.work() : ShadeWork(),
                inputs.work()};
  call.scene.merge_ms = merge_ms;
  return was_backward ? ReportBackward(backward, call) : ReportForward(forward, call);
}

Status ShadedRenderer::Impl::Backward(std::span<const ShadedScene> scenes,
                                      const RenderOptions& options, const ShadedFrame& frame,
                                      const ShadedFrameGradients& d_frame,
                                      std::span<ShadedGradients> d_scenes) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateShadedScenes(scenes));
  TILEGRAD_TRY(ValidateShadedBackward(scenes, options, d_frame, d_scenes));
  backward = PlanBackward(parts, WishesOf(d_frame, d_scenes));
  staged = backward.staged() && !scenes.empty(), was_backward = true;
  inputs.Begin(scenes, staged && backward.steps.texture);
  if (staged) {
    const bool normals = backward.pulled[Varying::kNormal] || backward.recomputed[Varying::kNormal];
    const bool same = backward.pulled == backward.recomputed;
    inputs.Pack(scenes, {backward.pulled, normals, same ? nullptr : &backward.recomputed});
    stage.BeginBackward(backward, inputs.scenes(), options, d_frame);
  } else {
    inputs.UsePlain(scenes, backward.colors_only, backward.user_only);
  }
  const std::span<SceneGradients> d_views = gradients.Begin(backward, inputs.views(), d_scenes);
  TILEGRAD_TRY(RunBackward(options, frame, d_frame, d_views));
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (d_scenes[n].camera) d_scenes[n].d_camera = d_views[n].d_camera;
  }
  MergeBackward(scenes, d_scenes);
  return ValidateShadedResult(d_scenes);
}

Status ShadedRenderer::Impl::RunBackward(const RenderOptions& options, const ShadedFrame& frame,
                                         const ShadedFrameGradients& d_frame,
                                         std::span<SceneGradients> d_views) {
  FrameGradients d_images{{}, d_frame.alpha};
  if (backward.colors_only) d_images.attributes = d_frame.color;
  if (backward.user_only) d_images.attributes = d_frame.attributes;
  const Status status = renderer.Backward(inputs.views(), options, frame, d_images, d_views,
                                          staged ? &stage : nullptr);
  // Cotangents that pull nothing have been looked at by nobody.
  const bool unseen = !staged && !backward.colors_only && !backward.user_only;
  if (!status.ok() || unseen || (staged && !stage.sound())) {
    TILEGRAD_TRY(ValidateShadedCotangents(d_frame, frame.face_ids));
  }
  return status;
}

void ShadedRenderer::Impl::MergeBackward(std::span<const ShadedScene> scenes,
                                         std::span<ShadedGradients> d_scenes) {
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

ShadedRenderer::ShadedRenderer(const Workers& workers) : impl_(std::make_unique<Impl>(workers)) {}
ShadedRenderer::~ShadedRenderer() = default;
ShadedRenderer::ShadedRenderer(ShadedRenderer&&) noexcept = default;
ShadedRenderer& ShadedRenderer::operator=(ShadedRenderer&&) noexcept = default;

Status ShadedRenderer::Render(std::span<const ShadedScene> scenes, const RenderOptions& options,
                              const ShadedRequest& request, ShadedFrame* frame) {
  return impl_->Render(scenes, options, request, frame);
}

Status ShadedRenderer::Backward(std::span<const ShadedScene> scenes, const RenderOptions& options,
                                const ShadedFrame& frame, const ShadedFrameGradients& d_frame,
                                std::span<ShadedGradients> d_scenes) {
  return impl_->Backward(scenes, options, frame, d_frame, d_scenes);
}

PlanReport ShadedRenderer::Explain() const { return impl_->Explain(); }

}  // namespace tilegrad
