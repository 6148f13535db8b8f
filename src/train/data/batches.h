// SPDX-License-Identifier: Apache-2.0
// Training batches. The batch of step s is a pure function of (seed, s): checkpoints store no data
// order, and a resumed run continues as if it had never stopped.
#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "scene/camera.h"
#include "train/data/dataset.h"
#include "train/run/portion.h"

namespace tilegrad::train {

// The images of some models: [models][views][4][size][size] bytes.
struct ImageStore {
  ScratchBytes bytes;           // of these models, or of more
  std::vector<int> rows;        // index of each model in `bytes`; empty: its own
  std::vector<Camera> cameras;  // by view, the same for all models, or by model and view
  int models = 0, views = 0, size = 0;

  std::size_t ImageBytes() const {
    return 4 * static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  }
  std::size_t Place(int model, int view) const {
    return static_cast<std::size_t>(model) * static_cast<std::size_t>(views) +
           static_cast<std::size_t>(view);
  }
  std::span<const std::uint8_t> Image(int model, int view) const {
    const int row = rows.empty() ? model : rows[static_cast<std::size_t>(model)];
    return {bytes.data() + Place(row, view) * ImageBytes(), ImageBytes()};
  }
  const Camera& CameraOf(int model, int view) const {
    return cameras[Place(model, view) % cameras.size()];
  }
};

// Loads the images of these models, in order; errors name the file. Stops between models when
// `stop` is set. Maps more than `in_memory` bytes from the dataset's picture pack (picture_pack.h).
Result<ImageStore> LoadImageStore(const Dataset& dataset, const std::vector<int>& models,
                                  const Workers& workers, const Watch& watch,
                                  std::size_t in_memory = ScratchBytes::kInMemory);

// One object of a batch: the view that the network sees comes first, then the other views, all
// distinct.
struct Sample {
  int model = 0;
  std::vector<int> views;
  // Mirrored at the plane x = 0: pictures flipped from left to right, cameras with MirroredCamera.
  bool mirrored = false;
};

// Sees the world mirrored at x = 0 as `camera` sees the world, flipped from left to right; `size`:
// pixels a row. Projection is exact: u -> size - u, depth stays.
Camera MirroredCamera(const Camera& camera, int size);

// Every epoch shows each model once in a new order; the last batch of an epoch runs into the next.
class BatchOrder {
 public:
  // `mirrored`: share of the samples that are mirrored, [0, 1].
  BatchOrder(int models, int views, std::uint64_t seed, double mirrored = 0)
      : models_(models), views_(views), seed_(seed), mirrored_(mirrored) {}
  // `views` is at most the number of views there are. Thread-safe.
  std::vector<Sample> Batch(const Slots& slots, int views);
  // The whole batch of a step.
  std::vector<Sample> Batch(std::int64_t step, int size, int views) {
    return Batch(SlotsOf(step, size), views);
  }

 private:
  const std::vector<int>& Permutation(std::int64_t epoch);
  int models_, views_;
  std::uint64_t seed_;
  double mirrored_;
  std::mutex mutex_;  // of all below
  std::int64_t cached_epoch_ = -1;
  std::vector<int> permutation_;
};

}  // namespace tilegrad::train
