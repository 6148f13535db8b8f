// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/learned_weights.h"

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {

LearnedWeights::LearnedWeights(nn::Context& context, nn::Module& network,
                               const OptimizerConfig& config, std::int64_t steps)
    : network_(network),
      config_(config),
      steps_(steps),
      adam_(context, nn::Parameters(network),
            {.learning_rate = config.learning_rate, .beta1 = config.beta1, .beta2 = config.beta2}),
      average_(context, config.average > 0 ? nn::State(network) : std::vector<nn::NamedTensor>(),
               config.average) {}

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
