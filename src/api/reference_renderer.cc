// SPDX-License-Identifier: Apache-2.0
#include "api/reference_renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "api/narrow_scene.h"
#include "base/error.h"
#include "render/renderer_ref.h"

namespace tilegrad {
namespace {

using SceneD = ShadedSceneT<double>;
using FrameD = ShadedFrameT<double>;
using GradientsD = ShadedGradientsT<double>;

FrameD RenderImage(const SceneD& scene, const RenderOptions& options,
                   const ShadedRequest& request) {
  FrameD frame;
  const RowRange rows{0, options.height};
  const auto ids = FaceIdsRef<double>(scene, options, rows);
  ShadedRenderRef<double>(scene, options, request, ids, &frame);
  if (!request.barycentrics) return frame;
  FrameT<double> geometry;
  RenderRefWithFaces<double>(scene, options, {.alpha = false, .barycentrics = true}, ids, rows,
                             &geometry);
  frame.barycentrics.swap(geometry.barycentrics);
  return frame;
}

// Images of one scene behind each other.
template <class Images>  // pointer to a member
void Gather(const std::vector<FrameD>& frames, Images images, FrameD* out) {
  auto& all = out->*images;
  all.clear();
  for (const FrameD& frame : frames) {
    const auto& one = frame.*images;
    all.insert(all.end(), one.begin(), one.end());
  }
}

// The images n of `count` of a cotangent.
std::span<const double> Share(std::span<const double> images, std::size_t n, std::size_t count) {
  return images.subspan(n * (images.size() / count), images.size() / count);
}

ShadedFrameGradientsT<double> Share(const ShadedFrameGradientsT<double>& d, std::size_t n,
                                    std::size_t count) {
  ShadedFrameGradientsT<double> out;
  out.color = Share(d.color, n, count), out.alpha = Share(d.alpha, n, count);
  out.attributes = Share(d.attributes, n, count), out.normals = Share(d.normals, n, count);
  out.uv = Share(d.uv, n, count), out.depth = Share(d.depth, n, count);
  return out;
}

// Calls visit(a's array, b's array) for the arrays of two gradients.
template <class Visit>
void ForEachArray(const GradientsD& a, const GradientsD& b, const Visit& visit) {
  visit(a.positions, b.positions), visit(a.attributes, b.attributes), visit(a.colors, b.colors);
  visit(a.uvs, b.uvs), visit(a.normals, b.normals), visit(a.light_directions, b.light_directions);
  visit(a.sh, b.sh);
  for (std::size_t t = 0; t < a.textures.size(); ++t) visit(a.textures[t], b.textures[t]);
}

// Gradients of one scene, in arrays of their own: the caller's may be shared with other scenes.
class OwnGradients {
 public:
  explicit OwnGradients(const GradientsD& wanted) : d_(wanted), textures_(wanted.textures.size()) {
    d_.textures = textures_;
    std::size_t size = 0;
    const auto add = [&](std::span<double> array) { size += array.size(); };
    ForEachArray(wanted, wanted, [&](auto array, auto) { add(array); });
    values_.assign(size, 0.0);
    double* next = values_.data();
    const auto take = [&](std::span<double>& array) {
      array = {next, array.size()};
      next += array.size();
    };
    take(d_.positions), take(d_.attributes), take(d_.colors), take(d_.uvs), take(d_.normals);
    take(d_.light_directions), take(d_.sh);
    for (std::size_t t = 0; t < textures_.size(); ++t) take(textures_[t] = wanted.textures[t]);
  }

  GradientsD* get() { return &d_; }
  bool finite() const {
    const auto is_finite = [](double x) { return std::isfinite(x); };
    const auto& camera = d_.d_camera;
    return std::all_of(values_.begin(), values_.end(), is_finite) &&
           std::all_of(camera.rotation, camera.rotation + 9, is_finite) &&
           std::all_of(camera.translation, camera.translation + 3, is_finite);
  }

  void AddTo(GradientsD* out) const {
    ForEachArray(*out, d_, [](std::span<double> to, std::span<const double> from) {
      for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
    });
    out->d_camera = d_.d_camera;
  }

 private:
  GradientsD d_;
  std::vector<std::span<double>> textures_;
  std::vector<double> values_;
};

}  // namespace

Status ReferenceRenderer::Render(std::span<const SceneD> scenes, const RenderOptions& options,
                                 const ShadedRequest& request, FrameD* frame) {
  TILEGRAD_TRY(NarrowBatch(scenes).Validate(options));
  std::vector<FrameD> frames(scenes.size());
  workers_->For(scenes.size(), [&](std::size_t n, std::size_t) {
    frames[n] = RenderImage(scenes[n], options, request);
  });
  const int channels = scenes.empty() ? 0 : scenes[0].channels;
  SizeFrame(static_cast<int>(scenes.size()), channels, options, request, frame);
  Gather(frames, &FrameD::face_ids, frame), Gather(frames, &FrameD::attributes, frame);
  Gather(frames, &FrameD::alpha, frame), Gather(frames, &FrameD::depth, frame);
  Gather(frames, &FrameD::barycentrics, frame), Gather(frames, &FrameD::color, frame);
  Gather(frames, &FrameD::normals, frame), Gather(frames, &FrameD::uv, frame);
  if (request.alpha && options.soft_rule == SoftRule::kPaper) {
    frame->alpha_error_bound = std::numeric_limits<double>::infinity();
  }
  return {};
}

Status ReferenceRenderer::Backward(std::span<const SceneD> scenes, const RenderOptions& options,
                                   const FrameD& frame,
                                   const ShadedFrameGradientsT<double>& d_frame,
                                   std::span<GradientsD> d_scenes) {
  TILEGRAD_TRY(NarrowBatch(scenes).ValidateBackward(options, frame, d_frame, d_scenes));
  if (!d_frame.alpha.empty() && frame.alpha.size() != d_frame.alpha.size()) {
    return InvalidArgument("frame.alpha has {} numbers, expected {}", frame.alpha.size(),
                           d_frame.alpha.size());
  }
  if (scenes.empty()) return {};
  std::vector<OwnGradients> own(d_scenes.begin(), d_scenes.end());
  std::atomic<bool> finite = true;
  workers_->For(scenes.size(), [&](std::size_t n, std::size_t) {
    const std::size_t pixels = frame.face_ids.size() / scenes.size();
    ShadedRenderRefBackward<double>(scenes[n], options,
                                    std::span(frame.face_ids).subspan(n * pixels, pixels),
                                    Share(d_frame, n, scenes.size()), own[n].get());
    if (!own[n].finite()) finite = false;
  });
  if (!finite) return InvalidArgument("the gradient overflows");
  for (const GradientsD& d : d_scenes) {
    ForEachArray(d, d, [](auto array, auto) { std::fill(array.begin(), array.end(), 0.0); });
  }
  for (std::size_t n = 0; n < scenes.size(); ++n) own[n].AddTo(&d_scenes[n]);
  return {};
}

}  // namespace tilegrad
