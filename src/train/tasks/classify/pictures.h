// SPDX-License-Identifier: Apache-2.0
// Pictures of a dataset with their classes, as tensors.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "train/data/batches.h"
#include "train/tasks/next_batch.h"

namespace tilegrad::train {

struct LabelledImages {
  ImageStore images;
  std::vector<std::int32_t> labels;  // of each model: ModelInfo::class_index
};

Result<LabelledImages> LoadLabelled(const Dataset& dataset, const std::vector<int>& models,
                                    const Workers& workers, const ProgressSink& progress,
                                    const StopFlag& stop);

// Pixels that each picture of a batch is moved by to the right and down; black comes in.
struct Shift {
  int x = 0, y = 0;
};
// At most `most` each way, a pure function of seed and position.
Shift RandomShift(std::uint64_t seed, std::uint64_t position, int most);

struct LabelledBatch {
  nn::Tensor images;  // [n, 3, size, size], RGB over black in [0, 1]
  nn::Tensor labels;  // [n] of kI32
};
// The first view of each sample; one shift for each, or none for all. `data` outlives the work.
BatchWork<LabelledBatch> LabelledWork(nn::Context& context, const LabelledImages& data,
                                      std::vector<Sample> batch, std::vector<Shift> shifts);
// The same, on all workers.
LabelledBatch GatherLabelled(nn::Context& context, const LabelledImages& data,
                             std::span<const Sample> batch, std::span<const Shift> shifts = {});

// images: [n][4][size][size] planar RGBA bytes, RGB over black.
nn::Tensor ColorsOf(nn::Context& context, std::span<const std::uint8_t> images, int size);

}  // namespace tilegrad::train
