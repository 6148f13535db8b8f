// SPDX-License-Identifier: Apache-2.0
// A task of one network, optionally with a critic (tasks/adversary.h): in each step the network is
// updated first, then the critic, on the same pictures. Such a task defines its loss; steps, state,
// header and the log's progress are here.
#pragma once

#include <span>
#include <vector>

#include "nn/optim.h"
#include "train/run/log.h"
#include "train/tasks/adversary.h"
#include "train/tasks/common_config.h"
#include "train/tasks/learned_weights.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

class NetworkTask : public Task {
 public:
  RunHeader Header() override;
  double half_extent() const override { return lesson_.half_extent; }
  Result<std::string> Fingerprint(const Path& data, const Workers& workers) const override;

  int Updates(std::int64_t /*step*/) const override {
    return 1 + (adversary_ ? adversary_->updates() : 0);
  }
  Result<nn::StepVector<nn::Gradient>> Backward(const UpdateIndex& at, StepValues* out) override;
  Status Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) override;
  Result<std::vector<nn::NamedTensor>> Statistics() override;
  std::vector<nn::NamedTensor> State() override;
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) override;

 protected:
  virtual LearnedWeights& weights() = 0;
  // The loss of a portion of the step's batch, on the tape, summed by a LossSum of `out`. Sets
  // out->images.
  virtual Result<nn::Var> Loss(const UpdateIndex& at, const Slots& slots, StepValues* out) = 0;

  // The first part of Start: sets context_ and lesson_.batch.
  Status BeginStart(const TaskStart& start, std::int64_t batch);
  // `start.run`: initialises a new run's network with the weights that predict of `run`, a folder
  // or a checkpoint; the optimiser starts fresh.
  Status StartAs(const Path& run);

  nn::Context* context_ = nullptr;
  std::unique_ptr<Adversary> adversary_;  // made by Start; null: none
  struct Lesson {
    std::string source = {};                        // of the data
    int objects = 0;                                // per epoch
    std::int64_t batch = 1;                         // objects a step
    double half_extent = CameraRule().half_extent;  // of the data's objects
  } lesson_;                                        // complete after Start
};

// The dataset of a run. An error if it has no training models.
Result<Dataset> OpenTrainingData(const TaskStart& start);

}  // namespace tilegrad::train
