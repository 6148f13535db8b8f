// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/real_pictures.h"

#include <algorithm>
#include <memory>
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

// A batch under construction.
struct RealPictures::Drawing {
  RealPictures& pictures;
  std::vector<Sample> models;
  std::uint64_t first;  // position in the run
  ObjectViews out;
  std::vector<Status> failures = std::vector<Status>(models.size());

  void Run(std::size_t b, std::size_t lane) {
    const double start = ThreadSeconds();
    const auto rgba = pictures.DrawOne(models[b].model, first + b, lane);
    pictures.seconds_ += ThreadSeconds() - start;
    failures[b] = rgba.status();
    if (rgba.ok()) nn::WithFloatType(out.colors.dtype(), [&]<class T>(T) { Place<T>(*rgba, b); });
  }
  template <class T>
  void Place(std::span<const float> rgba, std::size_t b) {
    const std::size_t views = pictures.views_.size(), plane = rgba.size() / views / 4;
    for (std::size_t v = 0; v < views; ++v) {
      const auto view = rgba.subspan(4 * plane * v, 4 * plane);
      const std::size_t at = b * views + v;
      std::copy_n(view.begin(), 3 * plane, out.colors.data<T>() + 3 * plane * at);
      std::copy_n(view.begin() + static_cast<std::ptrdiff_t>(3 * plane), plane,
                  out.cover.data<T>() + plane * at);
    }
  }
  Result<ObjectViews> Finish() {
    for (const Status& failure : failures) TILEGRAD_TRY(failure);
    return std::move(out);
  }
};

RealPictures::RealPictures(nn::Context& context, const Job& job, MeshCache meshes)
    : context_(context),
      job_(job),
      stream_({job.config, NoLight(), job.camera, job.size, job.seed}, meshes,
              SideLoop::LanesOf(context.workers())),
      order_(static_cast<int>(meshes.size()), 1, job.seed),
      next_(context.workers()) {
  for (const Camera& camera : PrimaryCameras(job.camera, job.views)) views_.push_back({camera, {}});
}

BatchWork<ObjectViews> RealPictures::Work(const Batch& batch) {
  const auto models = order_.Batch(static_cast<std::int64_t>(batch.number), batch.count, 1);
  stream_.Expect(order_.Batch(static_cast<std::int64_t>(batch.number) + 1, batch.count, 1));
  const std::int64_t size = job_.size;
  const auto work =
      std::make_shared<Drawing>(Drawing{*this,
                                        models,
                                        batch.number * static_cast<std::uint64_t>(batch.count),
                                        {context_.Empty({batch.count, 3 * job_.views, size, size}),
                                         context_.Empty({batch.count, job_.views, size, size})}});
  return {models.size(), [work](std::size_t b, std::size_t lane) { work->Run(b, lane); },
          [work] { return work->Finish(); }};
}

Result<ObjectViews> RealPictures::Draw(const Batch& batch) {
  return MakeNow(Work(batch), context_.workers());
}

Result<std::span<const float>> RealPictures::DrawOne(int model, std::uint64_t position,
                                                     std::size_t lane) {
  TILEGRAD_TRY(stream_.SetUp(model, position, lane, views_));
  return stream_.Again(lane, Appearance::kTexture);
}

}  // namespace tilegrad::train
