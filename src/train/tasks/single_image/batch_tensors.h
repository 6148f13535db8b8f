// SPDX-License-Identifier: Apache-2.0
// The pictures of one step as tensors, from the dataset or rendered for it.
#pragma once

#include <vector>

#include "nn/context.h"
#include "scene/camera.h"
#include "train/data/batches.h"
#include "train/data/stream/textured_stream.h"
#include "train/tasks/next_batch.h"

namespace tilegrad::train {

// The tensors of one batch: what the network sees, and what the renders are held to.
struct BatchTensors {
  nn::Tensor input;             // [B, 4, size, size]
  nn::Tensor truth_colors;      // [B * views, 3, size, size]
  nn::Tensor truth_alpha;       // [B * views, size, size]
  std::vector<Camera> cameras;  // [B * views]
  double stream_seconds = 0;    // of processor time, for pictures that were rendered for it
};
BatchTensors GatherBatch(nn::Context& context, const ImageStore& store,
                         const std::vector<Sample>& batch);
// Of a batch the first objects, which are rendered for it.
struct StreamedObjects {
  TexturedStream* from = nullptr;  // null: all are of the store
  std::int64_t first = 0;          // position in the run of the batch's first object
};
// `store` and the stream outlive the work, whose lanes are the stream's.
BatchWork<BatchTensors> GatherWork(nn::Context& context, const ImageStore& store,
                                   std::vector<Sample> batch, const StreamedObjects& stream);

}  // namespace tilegrad::train
