// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.1: images -> network -> renderer -> losses of equation 14 ->
// gradients -> Adam.
#pragma once

#include "train/tasks/learned_weights.h"
#include "train/tasks/single_image/image_losses.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// Network, optimiser and renderer of a run.
class TrainStep {
 public:
  // The words of config.render and config.rivals are known (RivalOptions).
  TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size);

  // Equation 14 of a batch, on the tape; `values` gets the sum and its terms.
  nn::Var Loss(const BatchTensors& batch, std::int64_t step, StepValues* values);

  MeshNetwork& network() { return network_; }
  LearnedWeights& weights() { return weights_; }
  ImageLosses& losses() { return losses_; }

 private:
  nn::Context& context_;
  SingleImageConfig config_;
  MeshNetwork network_;
  LearnedWeights weights_;
  ImageLosses losses_;
};

}  // namespace tilegrad::train
