// SPDX-License-Identifier: Apache-2.0
// Batch normalisation (Ioffe, Szegedy 2015), optionally followed by ReLU in the same pass.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

struct BatchNormOptions {
  double epsilon = 1e-5;
  bool relu = false;  // y = max(0, normalised)
};

struct BatchNormResult {
  Var y;
  Tensor mean;      // [c] of this batch
  Tensor variance;  // [c], biased: divided by the count
};

// x [n, c] or [n, c, h, w]; gamma, beta [c]; statistics over all axes but c, which must hold at
// least two elements. y = gamma (x - mean) / sqrt(variance + epsilon) + beta.
BatchNormResult BatchNormTrain(const Var& x, const Var& gamma, const Var& beta,
                               const BatchNormOptions& options = {});

// With given statistics, which take no gradient.
struct BatchStatistics {
  Tensor mean, variance;  // [c]
};
Var BatchNormEval(const Var& x, const Var& gamma, const Var& beta,
                  const BatchStatistics& statistics, const BatchNormOptions& options = {});

}  // namespace tilegrad::nn
