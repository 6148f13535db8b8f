// SPDX-License-Identifier: Apache-2.0
// The weights of a network as training moves and keeps them: Adam under a schedule, and a moving
// average that predicts.
#pragma once

#include <span>
#include <vector>

#include "nn/optim.h"
#include "train/run/step_values.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

class LearnedWeights {
 public:
  // Of a run of `steps`. `network` outlives it.
  LearnedWeights(nn::Context& context, nn::Module& network, const OptimizerConfig& config,
                 std::int64_t steps);

  // Of `loss`, a LossSum's that `values` has. One that is not finite, or whose gradients are not,
  // is an error with its terms.
  Result<nn::StepVector<nn::Gradient>> Gradients(const nn::Var& loss,
                                                 nn::GradientListener* listener,
                                                 const StepValues& values);
  // One step of Adam, and of the moving average if there is one. `share`: of Adam::Step.
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
  nn::MovingAverage average_;  // of no tensors without OptimizerConfig::average
};

// The weights that predict: the averages, where the run kept some.
Status LoadPredictingWeights(nn::Module& network, const std::vector<nn::NamedTensor>& state);

}  // namespace tilegrad::train
