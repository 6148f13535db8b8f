// SPDX-License-Identifier: Apache-2.0
// Section 5.3: the losses that sharpen textures, added to equation 14: a critic that learns to
// distinguish rendered from true pictures (equation 15), feature matching with the critic, and a
// perceptual loss with a pretrained network (equation 16).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nn/networks.h"
#include "train/losses/l1.h"
#include "train/losses/loss_sum.h"
#include "train/losses/wgan_gp.h"
#include "train/run/config_fields.h"
#include "train/run/portion.h"
#include "train/run/run.h"
#include "train/tasks/learned_weights.h"

namespace tilegrad::train {

// A weight of 0 disables its term. Section 5.3 uses 0.5, 1, 1, a penalty of 0.5 and a rate of 1e-5.
struct AdversaryConfig {
  double weight = 0;                 // lambda_adv
  double features = 0;               // of feature matching with the critic
  double perceptual = 0;             // lambda_per
  std::string network = "classify";  // PerceptualSource
  std::string network_file = {};
  double penalty = 0.5;
  std::string place = "rendered";                           // PenaltyPlace
  double learning_rate = 1e-5, beta1 = 0.5, beta2 = 0.999;  // of the critic's Adam
  std::int64_t base = 32, halvings = 4;                     // CriticShape
  std::int64_t updates = 1;                                 // of the critic per step

  bool HasCritic() const { return weight > 0 || features > 0; }
};

ConfigFields FieldsOf(AdversaryConfig* config);

class Adversary {
 public:
  // Errors: an unknown word, an unreadable perceptual network.
  static Result<std::unique_ptr<Adversary>> Make(nn::Context& context,
                                                 const AdversaryConfig& config,
                                                 const Schedule& schedule);

  struct Pictures {
    nn::Var rendered;      // [n, 3, size, size]
    nn::Tensor truth;      // likewise
    Portion portion = {};  // of the batch
  };
  // Adds the terms with non-zero weight. Keeps both pictures, detached, for the critic's updates on
  // this portion, which follow.
  void AddLosses(const Pictures& pictures, LossSum* sum);

  // Updates of the critic in each step; 0 without one.
  int updates() const { return critic_ ? static_cast<int>(config_.updates) : 0; }
  struct CriticStep {
    std::int64_t step = 0;
    int update = 0;  // of the critic, from 0
    Portion portion = {};
    nn::GradientListener* listener = nullptr;
  };
  // Gradients of WganCriticLoss on the pictures that AddLosses kept. The first update appends the
  // critic's logged terms.
  Result<nn::StepVector<nn::Gradient>> CriticGradients(const CriticStep& at, StepValues* values);
  Status UpdateCritic(std::span<const nn::Gradient> gradients, nn::UpdateShare* share) {
    return critic_->Update(gradients, 0, share);
  }

  // Combines the fingerprint `data` with that of the perceptual network, if there is one.
  Result<std::string> Fingerprint(const std::string& data) const;

  // Weights and moments of the critic, named "critic...".
  std::vector<nn::NamedTensor> State();
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps);
  nn::Critic* critic() { return critic_ ? &critic_->network() : nullptr; }
  std::vector<nn::NamedTensor> Buffers();  // statistics of the critic's layers

 private:
  Adversary(nn::Context& context, const AdversaryConfig& config, PenaltyPlace place,
            const Schedule& schedule);

  nn::Context& context_;
  AdversaryConfig config_;
  std::optional<LearnedCritic> critic_;
  FeatureFunction perceptual_;
  std::vector<LearnedCritic::Pair> kept_;  // of the last step, by portion
};

}  // namespace tilegrad::train
