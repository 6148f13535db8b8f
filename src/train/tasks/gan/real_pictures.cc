// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/real_pictures.h"

#include <algorithm>
#include <utility>

#include "base/clocks.h"
#include "base/error.h"

namespace tilegrad::train {
namespace {

// Width and height in pixels of what is covered by half and more.
template <class T>
std::array<double, 2> BoxOf(std::span<const T> plane, std::size_t side) {
  std::size_t left = side, right = 0, top = side, bottom = 0;
  for (std::size_t i = 0; i < plane.size(); ++i) {
    if (plane[i] < T(0.5)) continue;
    left = std::min(left, i % side);
    right = std::max(right, i % side + 1);
    top = std::min(top, i / side);
    bottom = std::max(bottom, i / side + 1);
  }
  if (right == 0) return {1, 1};
  return {static_cast<double>(right - left), static_cast<double>(bottom - top)};
}

}  // namespace

std::vector<Camera> PrimaryCameras(const CameraRule& rule, std::int64_t count) {
  // Azimuth and elevation, degrees: objects face +z, which is 90.
  constexpr double kDirections[kMostViews][2] = {{90, 15}, {0, 10},  {270, 15},
                                                 {90, 80}, {50, 25}, {310, 25}};
  std::vector<Camera> out;
  for (std::int64_t v = 0; v < count; ++v)
    out.push_back(OrbitCamera(rule.lens, kDirections[v][0], kDirections[v][1], rule.distance));
  return out;
}

std::array<double, 3> MeanHalfAxes(const ObjectViews& views, const CameraRule& rule) {
  constexpr double kInside = 0.9;  // of the box: shapes grow rather than shrink
  const nn::Shape& shape = views.cover.shape();
  std::array<double, 2> front = {}, side = {};
  nn::WithFloatType(views.cover.dtype(), [&]<class T>(T) {
    const auto plane = static_cast<std::size_t>(shape[2] * shape[3]);
    const auto of = [&](std::int64_t object, std::int64_t view) {
      const auto at = static_cast<std::size_t>(object * shape[1] + view) * plane;
      return BoxOf(views.cover.span<T>().subspan(at, plane), static_cast<std::size_t>(shape[3]));
    };
    for (std::int64_t i = 0; i < shape[0]; ++i) {
      const auto f = of(i, 0), s = of(i, std::min<std::int64_t>(1, shape[1] - 1));
      for (std::size_t k = 0; k < 2; ++k) {
        front[k] += f[k] / static_cast<double>(shape[0]);
        side[k] += s[k] / static_cast<double>(shape[0]);
      }
    }
  });
  const double world =
      kInside * rule.distance / static_cast<double>(PrimaryCameras(rule, 1)[0].fy) / 2;
  return {world * front[0], world * side[1], world * side[0]};
}

RealPictures::RealPictures(nn::Context& context, const Job& job, MeshCache meshes)
    : context_(context),
      job_(job),
      stream_({job.config, NoLight(), job.camera, job.size, job.seed}, meshes, context.workers()),
      order_(static_cast<int>(meshes.size()), 1, job.seed) {
  for (const Camera& camera : PrimaryCameras(job.camera, job.views)) views_.push_back({camera, {}});
}

Result<ObjectViews> RealPictures::Draw(std::uint64_t number, int count) {
  const auto models = order_.Batch(static_cast<std::int64_t>(number), count, 1);
  stream_.Expect(order_.Batch(static_cast<std::int64_t>(number) + 1, count, 1));
  const std::int64_t size = job_.size;
  ObjectViews out{context_.Empty({count, 3 * job_.views, size, size}),
                  context_.Empty({count, job_.views, size, size})};
  TILEGRAD_TRY(Place(models, number * static_cast<std::uint64_t>(count), &out));
  return out;
}

Result<std::span<const float>> RealPictures::DrawOne(int model, std::uint64_t position,
                                                     std::size_t worker) {
  TILEGRAD_TRY(stream_.SetUp(model, position, worker, views_));
  return stream_.Again(worker, Appearance::kTexture);
}

double RealPictures::TakeSeconds() {
  double sum = 0;
  for (double& seconds : seconds_) sum += std::exchange(seconds, 0);
  return sum;
}

Status RealPictures::Place(std::span<const Sample> models, std::uint64_t first, ObjectViews* out) {
  failures_.assign(models.size(), {});
  seconds_.resize(std::max(seconds_.size(), models.size()));
  const auto plane = static_cast<std::size_t>(job_.size) * static_cast<std::size_t>(job_.size);
  nn::WithFloatType(context_.dtype(), [&]<class T>(T) {
    T* const colors = out->colors.data<T>();
    T* const cover = out->cover.data<T>();
    context_.workers().For(models.size(), [&](std::size_t b, std::size_t worker) {
      const double start = ThreadSeconds();
      const auto rgba = DrawOne(models[b].model, first + b, worker);
      seconds_[b] += ThreadSeconds() - start;
      failures_[b] = rgba.status();
      if (!rgba.ok()) return;
      for (std::size_t v = 0; v < views_.size(); ++v) {
        const auto view = rgba->subspan(4 * plane * v, 4 * plane);
        const std::size_t at = b * views_.size() + v;
        std::copy_n(view.begin(), 3 * plane, colors + 3 * plane * at);
        std::copy_n(view.begin() + static_cast<std::ptrdiff_t>(3 * plane), plane,
                    cover + plane * at);
      }
    });
  });
  for (const Status& failure : failures_) TILEGRAD_TRY(failure);
  return {};
}

}  // namespace tilegrad::train
