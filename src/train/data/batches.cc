// SPDX-License-Identifier: Apache-2.0
#include "train/data/batches.h"

#include <algorithm>
#include <numeric>

#include "base/error.h"
#include "base/rng.h"
#include "train/data/picture_pack.h"

namespace tilegrad::train {
namespace {

// Streams of the run's seed; the network's weights have theirs in models/.
constexpr std::uint64_t kOrderStream = 0x6f72646572, kViewStream = 0x76696577,
                        kMirrorStream = 0x6d6972726f72;

Result<std::vector<Camera>> LoadStoreCameras(const Dataset& dataset,
                                             const std::vector<int>& models) {
  if (!dataset.info().own_cameras) return CamerasOf(dataset.info(), {});
  std::vector<Camera> out;
  for (const int model : models) {
    TILEGRAD_ASSIGN(const std::vector<Camera> cameras, dataset.LoadCameras(model));
    out.insert(out.end(), cameras.begin(), cameras.end());
  }
  return out;
}

}  // namespace

Result<ImageStore> LoadImageStore(const Dataset& dataset, const std::vector<int>& models,
                                  const Workers& workers, const Watch& watch,
                                  std::size_t in_memory) {
  ImageStore store;
  store.models = static_cast<int>(models.size());
  store.views = dataset.info().views;
  store.size = dataset.info().image_size;
  TILEGRAD_ASSIGN(store.cameras, LoadStoreCameras(dataset, models));
  const std::size_t per_model = store.ImageBytes() * static_cast<std::size_t>(store.views);
  if (per_model * models.size() > in_memory) {
    TILEGRAD_ASSIGN(auto pack, OpenPicturePack(dataset, workers, watch));
    if (pack) {
      store.bytes = std::move(*pack);
      store.rows = models;
      return store;
    }
  }
  store.bytes.Resize(per_model * models.size());
  TILEGRAD_TRY(UnpackPictures(dataset, models, workers, watch, [&](std::size_t i, auto images) {
    std::ranges::copy(images, store.bytes.begin() + i * per_model);
    return Status();
  }));
  return store;
}

Camera MirroredCamera(const Camera& camera, int size) {
  Camera out = camera;  // M R M and M t, with M = diag(-1, 1, 1)
  for (const int entry : {1, 2, 3, 6}) out.rotation[entry] = -out.rotation[entry];
  out.translation[0] = -out.translation[0];
  out.cx = static_cast<float>(size) - out.cx;
  return out;
}

const std::vector<int>& BatchOrder::Permutation(std::int64_t epoch) {
  if (epoch != cached_epoch_) {
    permutation_.resize(static_cast<std::size_t>(models_));
    std::iota(permutation_.begin(), permutation_.end(), 0);
    Rng rng(seed_ ^ kOrderStream, static_cast<std::uint64_t>(epoch));
    for (std::size_t i = permutation_.size(); i > 1; --i)
      std::swap(permutation_[i - 1], permutation_[rng.Below(i)]);
    cached_epoch_ = epoch;
  }
  return permutation_;
}

std::vector<Sample> BatchOrder::Batch(const Slots& slots, int views) {
  const std::scoped_lock lock(mutex_);
  std::vector<Sample> batch;
  for (std::int64_t i = 0; i < slots.count; ++i) {
    const std::int64_t position = slots.first + i;
    Sample sample{Permutation(position / models_)[static_cast<std::size_t>(position % models_)],
                  {}};
    // The first `views` of a random permutation of all views.
    std::vector<int> all(static_cast<std::size_t>(views_));
    std::iota(all.begin(), all.end(), 0);
    Rng rng(seed_ ^ kViewStream, static_cast<std::uint64_t>(position));
    for (int v = 0; v < views; ++v) {
      std::swap(
          all[static_cast<std::size_t>(v)],
          all[static_cast<std::size_t>(v) + rng.Below(static_cast<std::uint64_t>(views_ - v))]);
      sample.views.push_back(all[static_cast<std::size_t>(v)]);
    }
    sample.mirrored =
        Rng(seed_ ^ kMirrorStream, static_cast<std::uint64_t>(position)).Uniform() < mirrored_;
    batch.push_back(std::move(sample));
  }
  return batch;
}

}  // namespace tilegrad::train
