// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/batch_norm.h"

#include "nn/kernels/batch_norm_ref.h"

namespace tilegrad::nn {

void BatchNormForward(const BatchNormForwardProblem<float>& problem, const Workers& workers) {
  workers.For(problem.shape.channels,
              [&](std::size_t c, std::size_t) { BatchNormForwardRef(problem, c); });
}

void BatchNormForward(const BatchNormForwardProblem<double>& problem, const Workers& workers) {
  workers.For(problem.shape.channels,
              [&](std::size_t c, std::size_t) { BatchNormForwardRef(problem, c); });
}

void BatchNormBackward(const BatchNormBackwardProblem<float>& problem, const Workers& workers) {
  workers.For(problem.shape.channels,
              [&](std::size_t c, std::size_t) { BatchNormBackwardRef(problem, c); });
}

void BatchNormBackward(const BatchNormBackwardProblem<double>& problem, const Workers& workers) {
  workers.For(problem.shape.channels,
              [&](std::size_t c, std::size_t) { BatchNormBackwardRef(problem, c); });
}

}  // namespace tilegrad::nn
