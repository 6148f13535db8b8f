// SPDX-License-Identifier: Apache-2.0
// One of the critics of section 5.5 with its optimiser: of silhouettes, of pictures (D_I) or of
// texture maps (D_t).
#pragma once

#include <string>
#include <vector>

#include "nn/networks/gan.h"
#include "train/losses/loss_sum.h"
#include "train/tasks/gan/config.h"
#include "train/tasks/learned_weights.h"

namespace tilegrad::train {

// A term of the log, as LossSum::Add takes it.
struct TermWords {
  const char *name, *label;
};
// What a critic compares, and what is watched of it.
struct CriticRole {
  const char* prefix;  // of its tensors in checkpoints
  TermWords adversarial, distance, penalty, gradient;
  std::int64_t channels;
  std::uint64_t stream;  // of its weights and interpolates
  nn::PadMode padding = nn::PadMode::kZero;
};

// Of the silhouettes in all views; of their colours; of maps, half of which go around.
CriticRole SilhouetteRole(std::int64_t views);
CriticRole PictureRole(std::int64_t views);
CriticRole TextureRole(const GeneratorConfig& maps);

class GanCritic {
 public:
  // `steps` of the stage that it learns in.
  GanCritic(nn::Context& context, const GanConfig& config, const CriticRole& role,
            std::int64_t steps);

  // -E[D(fake)]
  void AddGeneratorLoss(double weight, const nn::Var& fake, LossSum* sum);
  struct Pair {
    nn::Tensor real, fake;
  };
  struct Backward {
    std::uint64_t number = 0;  // of the batch, from which interpolates follow
    nn::GradientListener* listener = nullptr;
    StepValues* values = nullptr;  // what is watched is appended, if it is there
  };
  // Of WganCriticLoss. A loss or gradient that is not finite is an error.
  Result<nn::StepVector<nn::Gradient>> Gradients(const Pair& pair, const Backward& how);
  // `step` of its stage.
  Status Update(std::span<const nn::Gradient> gradients, std::int64_t step,
                nn::UpdateShare* share) {
    return weights_.Update(gradients, step, share);
  }
  const CriticRole& role() const { return role_; }

  std::vector<nn::NamedTensor> State();
  // After so many updates.
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t updates);
  nn::Critic& network() { return critic_; }

 private:
  nn::Context& context_;
  CriticRole role_;
  double penalty_;
  std::uint64_t seed_;
  nn::Critic critic_;
  LearnedWeights weights_;
};

// Tensors under prefix + name, and back: those that have the prefix, without it.
std::vector<nn::NamedTensor> WithPrefix(const std::string& prefix,
                                        std::vector<nn::NamedTensor> tensors);
std::vector<nn::NamedTensor> OfPrefix(const std::string& prefix,
                                      const std::vector<nn::NamedTensor>& tensors);

}  // namespace tilegrad::train
