// SPDX-License-Identifier: Apache-2.0
// `start.run`: a new run whose network starts as that of another.
#pragma once

#include "base/file.h"
#include "nn/context.h"
#include "nn/layers.h"

namespace tilegrad::train {

// With the weights that predict there, and an optimiser that has taken no step. `run`: a run's
// folder, or a checkpoint. Errors: none there, or one of another network.
Status StartAs(nn::Context& context, nn::Module& network, const Path& run);

}  // namespace tilegrad::train
