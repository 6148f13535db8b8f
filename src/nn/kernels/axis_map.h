// SPDX-License-Identifier: Apache-2.0
// A sparse linear map along one axis, the same for every other index: resizing, padding and pooling
// are such maps, and the adjoint of one is the map of the transposed matrix.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/parallel.h"

namespace tilegrad::nn {

//   y[o, i, k] = sum_t weight[t] x[o, index[t], k],   begin[i] <= t < begin[i + 1]
// x [outer, in, inner], y [outer, out, inner]; sums run in the order of t.
template <class T>
struct AxisMapProblem {
  std::size_t outer = 1, in = 1, out = 1, inner = 1;
  const std::int32_t* begin = nullptr;  // [out + 1], not decreasing
  const std::int32_t* index = nullptr;  // [begin[out]], each in [0, in)
  const T* weight = nullptr;            // [begin[out]]
  const T* x = nullptr;
  T* y = nullptr;
};

void MapAxis(const AxisMapProblem<float>& problem, const Workers& workers);
void MapAxis(const AxisMapProblem<double>& problem, const Workers& workers);  // scalar

}  // namespace tilegrad::nn
