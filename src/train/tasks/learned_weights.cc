// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/learned_weights.h"

#include <cmath>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {

LearnedWeights::LearnedWeights(nn::Context& context, nn::Module& network,
                               const OptimizerConfig& config, std::int64_t steps)
    : context_(context),
      network_(network),
      config_(config),
      steps_(steps),
      adam_(context, nn::Parameters(network),
            {.learning_rate = config.learning_rate,
             .beta1 = config.beta1,
             .beta2 = config.beta2,
             .weight_decay = config.weight_decay}),
      average_(context, config.average > 0 ? nn::State(network) : std::vector<nn::NamedTensor>(),
               config.average) {}

Result<nn::StepVector<nn::Gradient>> LearnedWeights::Gradients(const nn::Var& loss,
                                                               nn::GradientListener* listener,
                                                               const StepValues& values) {
  auto gradients = nn::Gradients(loss, adam_.parameters(), listener);
  TILEGRAD_TRY(context_.TakeStatus());
  if (std::isfinite(values.loss) && nn::IsFinite(context_, gradients)) return gradients;
  return InternalError(
      "the loss is {} ({}), the gradient's norm {}; a smaller optimizer.learning_rate may help",
      values.loss, values.DescribeTerms(), nn::GlobalNorm(context_, gradients));
}

Status LearnedWeights::Update(std::span<const nn::Gradient> gradients, std::int64_t step,
                              nn::UpdateShare* share) {
  adam_.options().learning_rate = LearningRateAt(config_, steps_, step);
  TILEGRAD_TRY(adam_.Step(gradients, share));
  average_.Update();
  return {};
}

std::vector<nn::NamedTensor> LearnedWeights::State() {
  std::vector<nn::NamedTensor> tensors = nn::State(network_);
  for (const auto& more : {adam_.State(), average_.State()})
    tensors.insert(tensors.end(), more.begin(), more.end());
  return tensors;
}

Status LearnedWeights::LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) {
  TILEGRAD_TRY(nn::LoadState(network_, state));
  TILEGRAD_TRY(adam_.LoadState(state));
  TILEGRAD_TRY(average_.LoadState(state));
  if (adam_.steps() == steps) return {};
  return InvalidArgument("the optimizer has taken {} steps, the run {}", adam_.steps(), steps);
}

Status LoadPredictingWeights(nn::Module& network, const std::vector<nn::NamedTensor>& state) {
  const std::vector<nn::NamedTensor> averages = nn::Averages(state);
  return nn::LoadState(network, averages.empty() ? state : averages);
}

}  // namespace tilegrad::train
