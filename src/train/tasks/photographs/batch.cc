// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/photographs/batch.h"

#include <algorithm>
#include <memory>
#include <utility>

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

// A batch under construction.
struct Cutting {
  nn::Context& context;
  const PhotographsConfig& config;
  const PhotoStore& store;
  PhotographPlaces places;
  PhotographBatch batch;

  void Run(std::size_t i) {
    const auto plane =
        static_cast<std::size_t>(store.size()) * static_cast<std::size_t>(store.size());
    Pixels pixels{std::vector<float>(3 * plane), std::vector<float>(plane), {}};
    const auto seed = static_cast<std::uint64_t>(config.schedule.seed);
    const bool random = places.first >= 0;
    const std::uint64_t position =
        static_cast<std::uint64_t>(std::max<std::int64_t>(places.first, 0)) + i;
    batch.crops[i] =
        store.Cut(places.photographs[i], {seed, position, random, 0.5}, pixels.rgb, pixels.mask);
    if (!batch.barrier.empty()) {
      pixels.barrier.resize(plane);
      DistanceBarrier(pixels.mask, store.size(), pixels.barrier);
    }
    const bool cutout = random && Rng(seed ^ kCutoutStream, position).Uniform() < config.cutouts;
    nn::WithFloatType(batch.input.dtype(),
                      [&]<class T>(T) { Place<T>(std::move(pixels), cutout, i, &batch); });
  }
  PhotographBatch Finish() {
    for (const CroppedPhoto& crop : batch.crops) batch.cameras.push_back(crop.camera);
    AddKeypoints(context, &batch);
    return std::move(batch);
  }
};

}  // namespace

BatchWork<PhotographBatch> PhotographWork(nn::Context& context, const PhotographsConfig& config,
                                          const PhotoStore& store, PhotographPlaces places) {
  const std::size_t count = places.photographs.size();
  const auto b = static_cast<std::int64_t>(count);
  const std::int64_t s = store.size();
  PhotographBatch batch;
  batch.input = context.Empty({b, 3, s, s});
  batch.colors = context.Empty({b, 3, s, s});
  batch.mask = context.Empty({b, s, s});
  if (config.network.texture == "flow") batch.barrier = context.Empty({b, 1, s, s});
  batch.crops.resize(count);
  const auto work = std::make_shared<Cutting>(
      Cutting{context, config, store, std::move(places), std::move(batch)});
  return {count, [work](std::size_t i, std::size_t) { work->Run(i); },
          [work] { return work->Finish(); }};
}

PhotographBatch GatherPhotographs(nn::Context& context, const PhotographsConfig& config,
                                  const PhotoStore& store, const std::vector<int>& photographs,
                                  std::int64_t first) {
  return *MakeNow(PhotographWork(context, config, store, {photographs, first}), context.workers());
}

}  // namespace tilegrad::train
