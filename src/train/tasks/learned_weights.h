// SPDX-License-Identifier: Apache-2.0
// The weights of a network during training: Adam with a learning-rate schedule, and a moving
// average that predicts.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "nn/networks.h"
#include "nn/optim.h"
#include "train/losses/loss_sum.h"
#include "train/losses/wgan_gp.h"
#include "train/run/log.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

class LearnedWeights {
 public:
  // For a run of `steps` steps. `network` outlives it.
  LearnedWeights(nn::Context& context, nn::Module& network, const OptimizerConfig& config,
                 std::int64_t steps);

  // Gradients of `loss`, the LossSum recorded in `values`. A loss or gradient that is not finite is
  // an error that lists the terms.
  Result<nn::StepVector<nn::Gradient>> Gradients(const nn::Var& loss,
                                                 nn::GradientListener* listener,
                                                 const StepValues& values);
  // One step of Adam, and of the moving average if there is one. `share`: see Adam::Step.
  Status Update(std::span<const nn::Gradient> gradients, std::int64_t step,
                nn::UpdateShare* share = nullptr);

  // Weights and statistics, moments, averages. An error if the state is not that of `steps` steps.
  std::vector<nn::NamedTensor> State();
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps);

  nn::Module& network() { return network_; }
  nn::Adam& adam() { return adam_; }
  std::int64_t steps() const { return steps_; }  // of the run
  double RateAt(std::int64_t step) const { return LearningRateAt(config_, steps_, step); }

 private:
  nn::Context& context_;
  nn::Module& network_;
  OptimizerConfig config_;
  std::int64_t steps_;
  nn::Adam adam_;
  nn::MovingAverage average_;  // empty without OptimizerConfig::average
};

// Loads the weights that predict: the moving averages, where the run kept some.
Status LoadPredictingWeights(nn::Module& network, const std::vector<nn::NamedTensor>& state);

// A critic with its optimiser: one side of the Wasserstein game (losses/wgan_gp.h).

// A logged term, as LossSum takes it; without a name it is not logged.
struct TermWords {
  const char *name = nullptr, *label = nullptr;
};

struct CriticRole {
  const char* prefix;  // of its tensors in checkpoints
  const char* keys;    // of its configuration, for messages
  TermWords adversarial, distance, penalty, gradient = {};
};

class LearnedCritic {
 public:
  struct Job {
    CriticRole role;
    nn::CriticShape shape;
    WganGpOptions game;
    OptimizerConfig optimizer;
    std::int64_t steps = 1;  // of the learning-rate schedule
    // The seed with `weights` determines the initial weights, with `interpolates` the penalty's
    // interpolates.
    std::uint64_t seed = 0, weights = 0, interpolates = 0;
  };
  LearnedCritic(nn::Context& context, const Job& job);

  // -E[D(fake)]
  void AddGeneratorLoss(double weight, const nn::Var& fake, LossSum* sum);
  struct Pair {
    nn::Tensor real, fake;
  };
  // Gradients of WganCriticLoss on batch `number`. A loss or gradient that is not finite is an
  // error. Appends the logged terms to `values`, unless null.
  Result<nn::StepVector<nn::Gradient>> Gradients(const Pair& pair, std::uint64_t number,
                                                 nn::GradientListener* listener,
                                                 StepValues* values);
  // `step` of the schedule.
  Status Update(std::span<const nn::Gradient> gradients, std::int64_t step,
                nn::UpdateShare* share) {
    return weights_.Update(gradients, step, share);
  }

  // Under the role's prefix; `updates`: taken so far.
  std::vector<nn::NamedTensor> State();
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t updates);
  nn::Critic& network() { return critic_; }

 private:
  static nn::Critic Make(nn::Context& context, const Job& job) {
    Rng rng(job.seed, job.weights);
    return {context, job.shape, rng};
  }

  nn::Context& context_;
  Job job_;
  nn::Critic critic_;
  LearnedWeights weights_;
};

// Adds the prefix to all names; and back: the tensors with the prefix, without it.
std::vector<nn::NamedTensor> WithPrefix(const std::string& prefix,
                                        std::vector<nn::NamedTensor> tensors);
std::vector<nn::NamedTensor> OfPrefix(const std::string& prefix,
                                      const std::vector<nn::NamedTensor>& tensors);
void Append(std::vector<nn::NamedTensor> more, std::vector<nn::NamedTensor>* all);

}  // namespace tilegrad::train
