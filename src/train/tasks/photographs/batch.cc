// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/photographs/batch.h"

#include <algorithm>

#include "train/data/photographs/distance_barrier.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kCutoutStream = 0x6375746f7574;

template <class T>
void Put(std::span<const float> from, T* to) {
  std::transform(from.begin(), from.end(), to, [](float x) { return static_cast<T>(x); });
}

struct Pixels {
  std::vector<float> rgb, mask, barrier;
};

// One photograph's planes, to place `b` of the batch.
template <class T>
void Place(Pixels pixels, bool cutout, std::size_t b, PhotographBatch* batch) {
  const std::size_t plane = pixels.mask.size();
  T* const input = batch->input.data<T>() + 3 * plane * b;
  if (!cutout) Put(pixels.rgb, input);
  for (std::size_t i = 0; i < pixels.rgb.size(); ++i) pixels.rgb[i] *= pixels.mask[i % plane];
  if (cutout) Put(pixels.rgb, input);
  Put(pixels.rgb, batch->colors.data<T>() + 3 * plane * b);
  Put(pixels.mask, batch->mask.data<T>() + plane * b);
  if (!pixels.barrier.empty()) Put(pixels.barrier, batch->barrier.data<T>() + plane * b);
}

void AddKeypoints(nn::Context& context, PhotographBatch* batch) {
  const std::size_t count = batch->crops[0].keypoints.size();
  if (count == 0) return;
  std::vector<double> places, visible;
  for (const CroppedPhoto& crop : batch->crops) {
    for (const Keypoint& k : crop.keypoints) {
      places.insert(places.end(), {k.x, k.y});
      visible.push_back(k.visible ? 1 : 0);
    }
  }
  const auto b = static_cast<std::int64_t>(batch->crops.size()),
             k = static_cast<std::int64_t>(count);
  batch->keypoints = context.From({b, k, 2}, std::span<const double>(places));
  batch->visible = context.From({b, k, 1}, std::span<const double>(visible));
}

}  // namespace

PhotographBatch GatherPhotographs(nn::Context& context, const PhotographsConfig& config,
                                  const PhotoStore& store, const std::vector<int>& photographs,
                                  std::int64_t first) {
  const auto b = static_cast<std::int64_t>(photographs.size());
  const std::int64_t s = store.size();
  const bool flow = config.network.texture == "flow";
  PhotographBatch batch;
  batch.input = context.Empty({b, 3, s, s});
  batch.colors = context.Empty({b, 3, s, s});
  batch.mask = context.Empty({b, s, s});
  if (flow) batch.barrier = context.Empty({b, 1, s, s});
  batch.crops.resize(photographs.size());
  const auto seed = static_cast<std::uint64_t>(config.schedule.seed);
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    context.workers().For(photographs.size(), [&](std::size_t i, std::size_t) {
      const auto plane = static_cast<std::size_t>(s * s);
      Pixels pixels{std::vector<float>(3 * plane), std::vector<float>(plane), {}};
      const std::uint64_t position =
          static_cast<std::uint64_t>(std::max<std::int64_t>(first, 0)) + i;
      batch.crops[i] =
          store.Cut(photographs[i], {seed, position, first >= 0, 0.5}, pixels.rgb, pixels.mask);
      if (flow) {
        pixels.barrier.resize(plane);
        DistanceBarrier(pixels.mask, static_cast<int>(s), pixels.barrier);
      }
      const bool cutout =
          first >= 0 && Rng(seed ^ kCutoutStream, position).Uniform() < config.cutouts;
      Place<T>(std::move(pixels), cutout, i, &batch);
    });
  });
  for (const CroppedPhoto& crop : batch.crops) batch.cameras.push_back(crop.camera);
  AddKeypoints(context, &batch);
  return batch;
}

}  // namespace tilegrad::train
