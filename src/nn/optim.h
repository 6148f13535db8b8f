// SPDX-License-Identifier: Apache-2.0
// Optimisers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "nn/layers.h"
#include "nn/tape.h"

namespace tilegrad::nn {

struct AdamCoefficients;  // of kernels/adam.h

struct AdamOptions {
  double learning_rate = 1e-3;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;  // added to sqrt(v / (1 - beta2^t)), as PyTorch does
};

// Adam (Kingma, Ba 2015): one pass over parameter, gradient and both moments.
class Adam {
 public:
  Adam(Context& context, std::vector<NamedVar> parameters, const AdamOptions& options);

  // One step along `gradients` (as Grad returns them for parameters()), each multiplied by
  // `gradient_scale` on the way (see ClipFactor). A gradient that is not valid or does not fit is
  // refused before anything is changed.
  Status Step(std::span<const Var> gradients, double gradient_scale = 1.0);

  std::vector<Var> parameters() const;  // in the order given
  std::int64_t steps() const { return steps_; }
  AdamOptions& options() { return options_; }  // schedules set learning_rate here

  // "adam.m.<name>", "adam.v.<name>" and "adam.steps" ([1] of kI64). Loading restores the same
  // bits; errors as CopyByName.
  std::vector<NamedTensor> State() const;
  Status LoadState(const std::vector<NamedTensor>& state);

 private:
  struct Slot {
    NamedVar parameter;
    Tensor m, v;
  };
  void Update(Slot& slot, const Tensor& gradient, const AdamCoefficients& coefficients);
  Context& context_;
  std::vector<Slot> slots_;
  AdamOptions options_;
  std::int64_t steps_ = 0;
};

// Square root of the sum of all squares, summed in double and in a fixed order. Not finite where a
// gradient is not: look before you step.
double GlobalNorm(Context& context, std::span<const Var> gradients);
// The factor that brings a norm above `max_norm` down to it: min(1, max_norm / norm).
double ClipFactor(double norm, double max_norm);

}  // namespace tilegrad::nn
