// SPDX-License-Identifier: Apache-2.0
#include "render/engine.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "base/clocks.h"
#include "base/error.h"
#include "render/reference.h"
#include "render/shading/report.h"
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

using SceneD = SceneT<double>;
using FrameD = FrameImagesT<double>;

FrameD RenderImage(const SceneD& scene, const RenderOptions& options, const Outputs& outputs) {
  FrameD frame;
  ReferenceRender<double>(scene, options, outputs, FaceIdsRef(scene, options), &frame);
  return frame;
}

// Concatenates the images of single scenes.
void Gather(const std::vector<FrameD>& frames, FrameD* out) {
  const auto gather = [](auto& all, const auto& one) {
    all.insert(all.end(), one.begin(), one.end());
  };
  out->face_ids.clear();
  ForEachOutput(
      0, [](const char*, int, auto& all) { all.clear(); }, *out);
  for (const FrameD& frame : frames) {
    gather(out->face_ids, frame.face_ids);
    ForEachOutput(
        0, [&](const char*, int, auto& all, const auto& one) { gather(all, one); }, *out, frame);
  }
}

// Image n of `count` of a cotangent.
FrameGradientsT<double> Share(const FrameGradientsT<double>& d, std::size_t n, std::size_t count) {
  FrameGradientsT<double> out = d;
  ForEachImage(
      0,
      [&](const char*, int, std::span<const double>& image) {
        const std::size_t size = image.size() / count;
        image = image.subspan(n * size, size);
      },
      out);
  return out;
}

}  // namespace

Engine::Engine(const Workers& workers)
    : workers_(&workers),
      pipeline_(workers),
      stage_(workers.size()),
      inputs_(workers),
      merge_(workers) {}

Status Engine::SetInputs(std::span<const Scene> scenes, const StreamSets& sets, bool colors_only,
                         bool user_only) {
  if (staged_) return inputs_.Pack(scenes, sets);
  inputs_.UsePlain(scenes, colors_only, user_only);
  return {};
}

Status Engine::Render(std::span<const Scene> scenes, const RenderOptions& options,
                      const Outputs& request, FrameImages* frame) {
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateScenes(scenes, options, *workers_));
  forward_ = PlanForward(parts, request);
  staged_ = forward_.staged() && !scenes.empty();
  was_backward_ = false;
  merge_ms_ = 0;
  inputs_.Begin(scenes, staged_ && forward_.steps.texture);
  TILEGRAD_TRY(SetInputs(scenes, {forward_.varyings, forward_.varyings[Varying::kNormal]},
                         forward_.colors_only, forward_.user_only));
  SizeFrame(scenes.size(), parts.user_channels, options, request, frame);
  Pipeline::Attributes attributes;
  if (staged_) {
    stage_.BeginForward(forward_, inputs_.scenes(), options, frame);
    attributes.stage = &stage_;
  } else {
    std::fill(frame->uv.begin(), frame->uv.end(), 0.0f);  // requested, but the scene has none
    if (forward_.colors_only) attributes.image = &frame->color;
    if (forward_.user_only) attributes.image = &frame->attributes;
  }
  pipeline_.Render(inputs_.views(), options, attributes, frame);
  return parts.may_overflow ? ValidateImages(*frame) : Status();
}

PlanReport Engine::Explain() const {
  CallWork call{pipeline_.stats(), pipeline_.times(), staged_ ? stage_.work() : ShadeWork(),
                inputs_.work()};
  call.scene.merge_ms = merge_ms_;
  return was_backward_ ? ReportBackward(backward_, call) : ReportForward(forward_, call);
}

Status Engine::Backward(std::span<const Scene> scenes, const RenderOptions& options,
                        const FrameImages& frame, const FrameGradients& d_frame,
                        GradientTargets<float>* targets) {
  TILEGRAD_ASSIGN(const SceneParts parts, ValidateScenes(scenes, options, *workers_));
  TILEGRAD_TRY(ValidateBackward<float>(scenes, options, frame, d_frame, targets->scenes()));
  backward_ = PlanBackward(parts, WishesOf(d_frame, targets->scenes()));
  staged_ = backward_.staged() && !scenes.empty();
  was_backward_ = true;
  inputs_.Begin(scenes, staged_ && backward_.steps.texture);
  const bool normals = backward_.pulled[Varying::kNormal] || backward_.recomputed[Varying::kNormal];
  const bool same = backward_.pulled == backward_.recomputed;
  TILEGRAD_TRY(SetInputs(scenes,
                         {backward_.pulled, normals, same ? nullptr : &backward_.recomputed},
                         backward_.colors_only, backward_.user_only));
  if (staged_) stage_.BeginBackward(backward_, inputs_.scenes(), options, d_frame);
  const bool sound =
      RunBackward(options, frame, d_frame, merge_.Begin(backward_, inputs_.views(), *targets));
  if (!sound) {
    TILEGRAD_TRY(CheckNumbers("d_frame.alpha", d_frame.alpha));
    TILEGRAD_TRY(ValidateCotangents(d_frame, frame.face_ids));
  }
  StageClock clock;
  merge_.Run({backward_, inputs_, staged_ ? &stage_ : nullptr, *targets});
  clock.Lap(&merge_ms_);
  TILEGRAD_TRY(targets->CheckSums());
  return sound ? Status() : InvalidArgument("the gradient overflows");  // one that nobody requested
}

bool Engine::RunBackward(const RenderOptions& options, const FrameImages& frame,
                         const FrameGradients& d_frame, std::span<PipelineGradients> d_views) {
  PipelineCotangents d_images{{}, d_frame.alpha};
  if (backward_.colors_only) d_images.attributes = d_frame.color;
  if (backward_.user_only) d_images.attributes = d_frame.attributes;
  const bool sound = pipeline_.Backward(inputs_.views(), options, frame, d_images, d_views,
                                        staged_ ? &stage_ : nullptr);
  if (staged_) return sound && stage_.sound();
  // Nothing has checked cotangents without effect yet.
  const bool seen = backward_.colors_only || backward_.user_only;
  return sound && (seen || ValidateCotangents(d_frame, frame.face_ids).ok());
}

Status ReferenceRenderer::Render(std::span<const SceneD> scenes, const RenderOptions& options,
                                 const Outputs& outputs, FrameD* frame) {
  TILEGRAD_TRY(ValidateScenes(scenes, options, *workers_).status());
  std::vector<FrameD> frames(scenes.size());
  workers_->For(scenes.size(),
                [&](std::size_t n) { frames[n] = RenderImage(scenes[n], options, outputs); });
  const int channels = scenes.empty() ? 0 : scenes[0].channels;
  SizeFrame(scenes.size(), channels, options, outputs, frame);
  Gather(frames, frame);
  if (outputs.alpha && options.alpha_rule == AlphaRule::kPaper) {
    frame->alpha_error_bound = std::numeric_limits<double>::infinity();
  }
  return {};
}

Status ReferenceRenderer::Backward(std::span<const SceneD> scenes, const RenderOptions& options,
                                   const FrameD& frame, const FrameGradientsT<double>& d_frame,
                                   GradientTargets<double>* targets) {
  TILEGRAD_TRY(ValidateScenes(scenes, options, *workers_).status());
  TILEGRAD_TRY(ValidateBackward(scenes, options, frame, d_frame, targets->scenes()));
  TILEGRAD_TRY(CheckNumbers("d_frame.alpha", d_frame.alpha));
  TILEGRAD_TRY(ValidateCotangents(d_frame, frame.face_ids));
  targets->SplitArrays();
  workers_->For(scenes.size(), [&](std::size_t n) {
    const std::size_t pixels = frame.face_ids.size() / scenes.size();
    ReferenceRenderBackward<double>(scenes[n], options,
                                    std::span(frame.face_ids).subspan(n * pixels, pixels),
                                    Share(d_frame, n, scenes.size()), targets->scenes()[n]);
  });
  targets->JoinArrays();
  return targets->CheckSums();
}

}  // namespace tilegrad
