// SPDX-License-Identifier: Apache-2.0
// A critic with its optimiser: one side of the Wasserstein game (losses/wgan_gp.h).
#pragma once

#include <string>
#include <vector>

#include "nn/gan.h"
#include "train/losses/loss_sum.h"
#include "train/losses/wgan_gp.h"
#include "train/tasks/learned_weights.h"

namespace tilegrad::train {

// A term of the log, as LossSum takes it; without a name nothing is noted.
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
    std::int64_t steps = 1;  // of the schedule of its rate
    // Weights follow from the seed and the first number, interpolates from it and the second.
    std::uint64_t seed = 0, weights = 0, interpolates = 0;
  };
  LearnedCritic(nn::Context& context, const Job& job);

  // -E[D(fake)]
  void AddGeneratorLoss(double weight, const nn::Var& fake, LossSum* sum);
  struct Pair {
    nn::Tensor real, fake;
  };
  // Of WganCriticLoss on batch `number`. A loss or gradient that is not finite is an error. What is
  // watched is appended to `values`, if they are there.
  Result<nn::StepVector<nn::Gradient>> Gradients(const Pair& pair, std::uint64_t number,
                                                 nn::GradientListener* listener,
                                                 StepValues* values);
  // `step` of the schedule.
  Status Update(std::span<const nn::Gradient> gradients, std::int64_t step,
                nn::UpdateShare* share) {
    return weights_.Update(gradients, step, share);
  }

  // Under the role's prefix; after so many updates.
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

// Tensors under prefix + name, and back: those that have the prefix, without it.
std::vector<nn::NamedTensor> WithPrefix(const std::string& prefix,
                                        std::vector<nn::NamedTensor> tensors);
std::vector<nn::NamedTensor> OfPrefix(const std::string& prefix,
                                      const std::vector<nn::NamedTensor>& tensors);
void Append(std::vector<nn::NamedTensor> more, std::vector<nn::NamedTensor>* all);

}  // namespace tilegrad::train
