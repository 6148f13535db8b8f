// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/step.h"

#include <cmath>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {

double LearningRateAt(const SingleImageConfig& config, std::int64_t step) {
  return LearningRateAt(config.optimizer, config.schedule.steps, step);
}

TrainStep::TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size)
    : context_(context),
      config_(config),
      network_(context, config.network, image_size,
               static_cast<std::uint64_t>(config.schedule.seed)),
      weights_(context, network_.module(), config.optimizer, config.schedule.steps),
      losses_(context, config, network_.template_mesh(), image_size) {}

nn::Var TrainStep::Loss(const BatchTensors& batch, std::int64_t step, StepValues* values) {
  const PredictedMeshes meshes =
      network_.Forward(nn::Constant(context_, batch.input), nn::Mode::kTrain);
  return losses_.Total(meshes, batch, step, values);
}

Result<nn::StepVector<nn::Gradient>> TrainStep::Backward(const BatchTensors& batch,
                                                         const UpdateIndex& at,
                                                         StepValues* values) {
  const nn::Var loss = Loss(batch, at.step, values);
  auto gradients = nn::Gradients(loss, weights_.adam().parameters(), at.listener);
  TILEGRAD_TRY(context_.TakeStatus());
  if (std::isfinite(values->loss) && nn::IsFinite(context_, gradients)) return gradients;
  return InternalError(
      "the loss is {} ({}), the gradient's norm {}; a smaller optimizer.learning_rate may help",
      values->loss, values->DescribeTerms(), nn::GlobalNorm(context_, gradients));
}

}  // namespace tilegrad::train
