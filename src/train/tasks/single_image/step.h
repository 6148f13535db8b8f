// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.1: images -> network -> renderer -> losses of equation 14 ->
// gradients -> Adam.
#pragma once

#include "nn/moving_average.h"
#include "nn/optim.h"
#include "train/tasks/single_image/image_losses.h"

namespace tilegrad::train {

// The learning rate of a step follows a schedule of the configuration.
double LearningRateAt(const SingleImageConfig& config, std::int64_t step);

// Network, optimiser and renderer of a run.
class TrainStep {
 public:
  // The words of config.render and config.rivals are known (RivalOptions).
  TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size);

  // Equation 14 of a batch, on the tape; `values` gets the parts.
  nn::Var Loss(const BatchTensors& batch, std::int64_t step, LossValues* values);
  // Gradients of the loss. A loss or gradient that is not finite is an error.
  Result<nn::StepVector<nn::Gradient>> Backward(const BatchTensors& batch, std::int64_t step,
                                                LossValues* values);
  // One step of Adam, and of the moving average of the weights if there is one.
  Status Update(std::span<const nn::Gradient> gradients, std::int64_t step);

  MeshNetwork& network() { return network_; }
  nn::Adam& adam() { return adam_; }
  nn::MovingAverage& average() { return average_; }  // of no tensors without optimizer.average
  ImageLosses& losses() { return losses_; }

 private:
  nn::Context& context_;
  SingleImageConfig config_;
  MeshNetwork network_;
  nn::Adam adam_;
  nn::MovingAverage average_;
  ImageLosses losses_;
};

}  // namespace tilegrad::train
