// SPDX-License-Identifier: Apache-2.0
// Pictures that training renders itself, while it trains: each object of a batch is a deformed,
// recoloured copy of a training model, seen by random cameras. A pure function of (seed, position
// of the object in the run): nothing has to be saved, and a resumed run goes on as if it had never
// stopped.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "scene/image.h"
#include "tilegrad/renderer.h"
#include "train/data/dataset.h"
#include "train/data/stream/object_draw.h"

namespace tilegrad::train {

// The meshes of some models, in memory, in the order of `models`; progress notes how much they
// take. Errors: a model file that cannot be read, a model without a mesh (of the source "nmr").
// Stops between models when `stop` is set.
Result<std::vector<ColoredMesh>> LoadStreamMeshes(const Dataset& dataset,
                                                  const std::vector<int>& models,
                                                  std::int64_t max_faces, const Workers& workers,
                                                  const ProgressSink& progress,
                                                  const StopFlag& stop);

class SceneStream {
 public:
  SceneStream(const StreamConfig& config, std::vector<ColoredMesh> meshes, const DatasetInfo& info,
              std::uint64_t seed, const Workers& workers);
  ~SceneStream();
  SceneStream(SceneStream&&) noexcept;

  // How many of `batch` objects are streamed: the first ones.
  std::size_t Count(std::size_t batch) const;
  // The object at `position` of the run, step * batch + slot, from as many views as there are
  // `cameras`, which are chosen: [views][4][size][size], planar, RGB over black and the covered
  // share of each pixel, in [0, 1]. Valid until the next call with the same `worker`, which is in
  // [0, workers.count()).
  Result<std::span<const float>> Render(int model, std::uint64_t position, std::size_t worker,
                                        std::span<Camera> cameras);

  // Of processor time that Render has taken since the last call. Between batches only.
  double TakeSeconds();

  // Rows of objects from models that are spread over all, to look at.
  Result<ImageU8> Sheet(int objects, int views);

 private:
  struct Worker;
  StreamConfig config_;
  std::vector<ColoredMesh> meshes_;
  CameraRule rule_;
  int size_;
  std::uint64_t seed_;
  std::vector<std::unique_ptr<Worker>> workers_;
};

}  // namespace tilegrad::train
