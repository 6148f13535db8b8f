// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/learned_weights.h"

#include <cmath>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

// What a scene may be refused for is the network's prediction: all else was checked before.
Status OfPrediction(const Status& status) {
  if (status.code() != StatusCode::kInvalidArgument) return status;
  return InternalError(
      "the prediction cannot be rendered: {}; a smaller optimizer.learning_rate may help",
      status.message());
}

}  // namespace

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
  TILEGRAD_TRY(OfPrediction(context_.TakeStatus()));
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

namespace {

void NoteTerm(const TermWords& words, double value, StepValues* values) {
  if (words.name != nullptr) LossSum(values).Watch(words.name, words.label, value);
}

}  // namespace

LearnedCritic::LearnedCritic(nn::Context& context, const Job& job)
    : context_(context),
      job_(job),
      critic_(Make(context, job)),
      weights_(context, critic_, job.optimizer, job.steps) {}

void LearnedCritic::AddGeneratorLoss(double weight, const nn::Var& fake, LossSum* sum) {
  const auto& [name, label] = job_.role.adversarial;
  sum->Add(name, label, weight, WganGeneratorLoss(critic_, fake));
}

Result<nn::StepVector<nn::Gradient>> LearnedCritic::Gradients(const Pair& pair,
                                                              std::uint64_t number,
                                                              nn::GradientListener* listener,
                                                              StepValues* values) {
  Rng rng(job_.seed ^ job_.interpolates, number);
  const CriticLoss loss = WganCriticLoss(critic_, nn::Constant(context_, pair.real),
                                         nn::Constant(context_, pair.fake), job_.game, rng);
  auto gradients = nn::Gradients(loss.total, weights_.adam().parameters(), listener);
  TILEGRAD_TRY(context_.TakeStatus());
  const double norm = nn::GlobalNorm(context_, gradients);
  if (!std::isfinite(loss.total.item()) || !std::isfinite(norm))
    return InternalError(
        "{}: the critic's loss is {}, its gradient's norm {}; a smaller {}.learning_rate or a "
        "larger {}.penalty may help",
        job_.role.distance.name, loss.total.item(), norm, job_.role.keys, job_.role.keys);
  if (values == nullptr) return gradients;
  NoteTerm(job_.role.distance, loss.wasserstein.item(), values);
  if (job_.game.penalty > 0) NoteTerm(job_.role.penalty, loss.penalty.item(), values);
  NoteTerm(job_.role.gradient, norm, values);
  return gradients;
}

std::vector<nn::NamedTensor> LearnedCritic::State() {
  return WithPrefix(job_.role.prefix, weights_.State());
}

Status LearnedCritic::LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t updates) {
  return weights_.LoadState(OfPrefix(job_.role.prefix, state), updates);
}

std::vector<nn::NamedTensor> WithPrefix(const std::string& prefix,
                                        std::vector<nn::NamedTensor> tensors) {
  for (nn::NamedTensor& tensor : tensors) tensor.name = prefix + tensor.name;
  return tensors;
}

std::vector<nn::NamedTensor> OfPrefix(const std::string& prefix,
                                      const std::vector<nn::NamedTensor>& tensors) {
  std::vector<nn::NamedTensor> out;
  for (const nn::NamedTensor& tensor : tensors) {
    if (tensor.name.starts_with(prefix))
      out.push_back({tensor.name.substr(prefix.size()), tensor.value});
  }
  return out;
}

void Append(std::vector<nn::NamedTensor> more, std::vector<nn::NamedTensor>* all) {
  for (nn::NamedTensor& tensor : more) all->push_back(std::move(tensor));
}

}  // namespace tilegrad::train
