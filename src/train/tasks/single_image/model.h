// SPDX-License-Identifier: Apache-2.0
// The trained network of section 5.1, ready to predict.
#pragma once

#include "train/models/mesh_network.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// Predictions have the template's faces, positions of CheckpointInfo::half_extent, centred, and
// vertex colours in [0, 1]; batch statistics are those of training (eval mode). Errors say what
// does not fit in the checkpoint.
Result<std::unique_ptr<Model>> LoadSingleImageModel(nn::Context& context,
                                                    const NetworkConfig& config,
                                                    const Checkpoint& checkpoint);

}  // namespace tilegrad::train
