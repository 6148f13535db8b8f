// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/start_as.h"

#include "base/error.h"
#include "train/run/checkpoint.h"
#include "train/tasks/learned_weights.h"

namespace tilegrad::train {

Status StartAs(nn::Context& context, nn::Module& network, const Path& run) {
  TILEGRAD_ASSIGN(const FoundCheckpoint found, FindCheckpoint(context, run));
  return LoadPredictingWeights(network, found.checkpoint.tensors).Within(run.string());
}

}  // namespace tilegrad::train
