// SPDX-License-Identifier: Apache-2.0
// The trained network of section 5.1, ready to predict.
#pragma once

#include <span>

#include "base/file.h"
#include "scene/image.h"
#include "train/models/mesh_network.h"
#include "train/tasks/single_image/step.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// Predictions have the template's faces, positions of CheckpointInfo::half_extent, centred, and
// vertex colours in [0, 1]; batch statistics are those of training (eval mode). Errors say what
// does not fit in the checkpoint.
Result<std::unique_ptr<Model>> LoadSingleImageModel(nn::Context& context,
                                                    const NetworkConfig& config,
                                                    const Checkpoint& checkpoint);

// Pictures of what a network does now: rows of input | prediction | truth ... for a few objects.

// One row an object: input view, its prediction, then each other view as prediction and truth; RGB
// composited over light grey, `zoom` screen pixels a pixel. Runs in eval mode, without gradient,
// with the weights of the last step even where their moving average predicts.
Result<ImageU8> SampleSheet(nn::Context& context, TrainStep& step, const ImageStore& store,
                            std::span<const Sample> samples, std::int64_t at_step);

}  // namespace tilegrad::train
