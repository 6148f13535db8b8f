// SPDX-License-Identifier: Apache-2.0
// Exponential moving average of weights, for evaluation: smoother than the weights in
// training.
//
//   MovingAverage average(context, State(net), 0.999);
//   ... each step:      average.Update();
//   ... to evaluate:    LoadState(other_net, average.values());
#pragma once

#include <vector>

#include "nn/context.h"
#include "nn/named_tensors.h"

namespace tilegrad::nn {

class MovingAverage {
 public:
  // Watches `tensors` (of kF32 or kF64), whose storage it shares; starts as a copy of them.
  MovingAverage(Context& context, std::vector<NamedTensor> tensors, double decay);
  void Update();  // average = decay average + (1 - decay) tensor

  const std::vector<NamedTensor>& values() const { return averages_; }  // by the tensors' names
  // "ema.<name>". Loading restores the same bits; errors as CopyByName.
  std::vector<NamedTensor> State() const;
  Status LoadState(const std::vector<NamedTensor>& state) { return CopyByName(state, State()); }

 private:
  Context& context_;
  double decay_;
  std::vector<NamedTensor> tensors_, averages_;
};

// The averages in `state`, which may hold anything else too, under the names of their tensors.
std::vector<NamedTensor> Averages(const std::vector<NamedTensor>& state);

}  // namespace tilegrad::nn
