// SPDX-License-Identifier: Apache-2.0
#include "render/reference_renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "base/error.h"
#include "render/checks.h"
#include "render/reference.h"
#include "render/validate.h"

namespace tilegrad {
namespace {

using SceneD = SceneT<double>;
using FrameD = FrameImagesT<double>;
using GradientsD = SceneGradientsT<double>;

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

// Gradients of one scene, in arrays of their own: the caller's may be shared with other scenes.
class OwnGradients {
 public:
  explicit OwnGradients(const GradientsD& wanted) : d_(wanted), textures_(wanted.textures.size()) {
    std::size_t size = 0;
    ForEachGradientArray(SceneD(), wanted,
                         [&](const char*, std::span<double> array, int) { size += array.size(); });
    values_.assign(size, 0.0);
    double* next = values_.data();
    const auto take = [&](const char*, std::span<double>& array) {
      array = {next, array.size()};
      next += array.size();
    };
    ForEachPlainArray(d_, take);
    std::copy(wanted.textures.begin(), wanted.textures.end(), textures_.begin());
    for (auto& texture : textures_) take("textures", texture);
    d_.textures = textures_;
    d_.camera = &camera_;
  }
  OwnGradients(const OwnGradients&) = delete;
  OwnGradients& operator=(const OwnGradients&) = delete;

  const GradientsD& get() const { return d_; }
  bool finite() const {
    const auto is_finite = [](double x) { return std::isfinite(x); };
    return std::all_of(values_.begin(), values_.end(), is_finite) &&
           std::all_of(camera_.rotation, camera_.rotation + 9, is_finite) &&
           std::all_of(camera_.translation, camera_.translation + 3, is_finite);
  }

  void AddTo(const GradientsD& out) const {
    const double* from = values_.data();
    ForEachGradientArray(SceneD(), out, [&](const char*, std::span<double> to, int) {
      for (double& x : to) x += *from++;
    });
    if (out.camera != nullptr) *out.camera = camera_;
  }

 private:
  GradientsD d_;
  CameraT<double> camera_;
  std::vector<std::span<double>> textures_;
  std::vector<double> values_;
};

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
                                   std::span<const GradientsD> d_scenes) {
  TILEGRAD_TRY(ValidateScenes(scenes, options, *workers_).status());
  TILEGRAD_TRY(ValidateBackward(scenes, options, frame, d_frame, d_scenes));
  TILEGRAD_TRY(CheckNumbers("d_frame.alpha", d_frame.alpha));
  TILEGRAD_TRY(ValidateCotangents(d_frame, frame.face_ids));
  if (scenes.empty()) return {};
  std::vector<std::unique_ptr<OwnGradients>> own;
  for (const GradientsD& d : d_scenes) own.push_back(std::make_unique<OwnGradients>(d));
  std::atomic<bool> finite = true;
  workers_->For(scenes.size(), [&](std::size_t n, std::size_t) {
    const std::size_t pixels = frame.face_ids.size() / scenes.size();
    ReferenceRenderBackward<double>(scenes[n], options,
                                    std::span(frame.face_ids).subspan(n * pixels, pixels),
                                    Share(d_frame, n, scenes.size()), own[n]->get());
    if (!own[n]->finite()) finite = false;
  });
  if (!finite) return InvalidArgument("the gradient overflows");
  for (const GradientsD& d : d_scenes) {
    ForEachGradientArray(SceneD(), d, [](const char*, std::span<double> array, int) {
      std::fill(array.begin(), array.end(), 0.0);
    });
  }
  for (std::size_t n = 0; n < scenes.size(); ++n) own[n]->AddTo(d_scenes[n]);
  return {};
}

}  // namespace tilegrad
