// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/step.h"

#include "nn/nn.h"

namespace tilegrad::train {

TrainStep::TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size)
    : context_(context),
      config_(config),
      network_(context, config.network, image_size,
               static_cast<std::uint64_t>(config.schedule.seed)),
      weights_(context, network_.module(), config.optimizer, config.schedule.steps),
      losses_(context, config, network_.sphere(), image_size) {}

nn::Var TrainStep::Loss(const BatchTensors& batch, std::int64_t step, StepValues* values) {
  const Prediction meshes = network_.Forward(nn::Constant(context_, batch.input), nn::Mode::kTrain);
  return losses_.Total(meshes, batch, step, values);
}

}  // namespace tilegrad::train
