// SPDX-License-Identifier: Apache-2.0
// A task of one network that a critic may watch (tasks/adversary.h): in each step the network is
// updated first, then the critic, on the same pictures.
#pragma once

#include "train/tasks/adversary.h"
#include "train/tasks/learned_weights.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

class AdversarialTask : public Task {
 public:
  int Updates(std::int64_t /*step*/) const override { return 1 + adversary_->updates(); }
  Status Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) override;
  Result<std::vector<nn::NamedTensor>> Statistics() override;
  std::vector<nn::NamedTensor> State() override;
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) override;

 protected:
  virtual nn::Module& network() = 0;
  virtual LearnedWeights& weights() = 0;

  // Of the updates after the first.
  Result<nn::StepVector<nn::Gradient>> CriticGradients(const UpdateIndex& at, StepValues* out) {
    return adversary_->CriticGradients({at.step, at.update - 1, at.portion, at.listener}, out);
  }

  std::unique_ptr<Adversary> adversary_;  // made when the task starts
};

}  // namespace tilegrad::train
