// SPDX-License-Identifier: Apache-2.0
// The pictures of one step as tensors, from the dataset or rendered for it.
#pragma once

#include <vector>

#include "nn/context.h"
#include "scene/camera.h"
#include "train/data/batches.h"
#include "train/data/stream/textured_stream.h"

namespace tilegrad::train {

// The tensors of one batch: what the network sees, and what the renders are held to.
struct BatchTensors {
  nn::Tensor input;             // [B, 4, size, size]
  nn::Tensor truth_colors;      // [B * views, 3, size, size]
  nn::Tensor truth_alpha;       // [B * views, size, size]
  std::vector<Camera> cameras;  // [B * views]
};
BatchTensors GatherBatch(nn::Context& context, const ImageStore& store,
                         const std::vector<Sample>& batch);
// The first objects of the batch are rendered instead; null: none are. `first`: position in the run
// of the first one.
Result<BatchTensors> GatherBatch(nn::Context& context, const ImageStore& store,
                                 const std::vector<Sample>& batch, TexturedStream* stream,
                                 std::int64_t first);

}  // namespace tilegrad::train
