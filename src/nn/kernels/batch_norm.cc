// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/batch_norm.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/batch_norm.cc"
#include <hwy/foreach_target.h>
//
#include "nn/kernels/batch_norm-inl.h"

#if HWY_ONCE

namespace tilegrad::nn {

HWY_EXPORT(BatchNormForwardRange);
HWY_EXPORT(BatchNormBackwardRange);

namespace {

// Channels to a task: with pixels, one is work enough.
std::size_t Grain(const BatchNormShape& shape) { return shape.pixels == 1 ? 64 : 1; }

}  // namespace

void BatchNormForward(const BatchNormForwardProblem<float>& problem, const Workers& workers) {
  workers.ForRanges(problem.shape.channels, Grain(problem.shape),
                    [&](std::size_t begin, std::size_t end) {
                      HWY_DYNAMIC_DISPATCH(BatchNormForwardRange)(problem, begin, end);
                    });
}

void BatchNormForward(const BatchNormForwardProblem<double>& problem, const Workers& workers) {
  workers.For(problem.shape.channels, [&](std::size_t c) { BatchNormForwardRef(problem, c); });
}

void BatchNormBackward(const BatchNormBackwardProblem<float>& problem, const Workers& workers) {
  workers.ForRanges(problem.shape.channels, Grain(problem.shape),
                    [&](std::size_t begin, std::size_t end) {
                      HWY_DYNAMIC_DISPATCH(BatchNormBackwardRange)(problem, begin, end);
                    });
}

void BatchNormBackward(const BatchNormBackwardProblem<double>& problem, const Workers& workers) {
  workers.For(problem.shape.channels, [&](std::size_t c) { BatchNormBackwardRef(problem, c); });
}

}  // namespace tilegrad::nn
#endif  // HWY_ONCE
