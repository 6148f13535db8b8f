// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <limits>
#include <vector>

#include "render/checks.h"
#include "render/engine.h"
#include "render/reference.h"
#include "render/validate.h"

namespace tilegrad {
namespace {

using SceneD = SceneT<double>;
using FrameD = FrameImagesT<double>;

FrameD RenderImage(const SceneD& scene, const RenderOptions& options, const Outputs& outputs) {
  FrameD frame;
  ReferenceRender<double>(scene, options, outputs, FaceIdsRef(scene, options), &frame);
  return frame;
}

// Images of one scene behind each other.
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

// The images n of `count` of a cotangent.
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

Status ReferenceRenderer::Render(std::span<const SceneD> scenes, const RenderOptions& options,
                                 const Outputs& outputs, FrameD* frame) {
  TILEGRAD_TRY(ValidateScenes(scenes, options, *workers_).status());
  std::vector<FrameD> frames(scenes.size());
  workers_->For(scenes.size(), [&](std::size_t n, std::size_t) {
    frames[n] = RenderImage(scenes[n], options, outputs);
  });
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
  workers_->For(scenes.size(), [&](std::size_t n, std::size_t) {
    const std::size_t pixels = frame.face_ids.size() / scenes.size();
    ReferenceRenderBackward<double>(scenes[n], options,
                                    std::span(frame.face_ids).subspan(n * pixels, pixels),
                                    Share(d_frame, n, scenes.size()), targets->scenes()[n]);
  });
  targets->JoinArrays();
  return targets->CheckSums();
}

}  // namespace tilegrad
