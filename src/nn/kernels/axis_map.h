// SPDX-License-Identifier: Apache-2.0
// A sparse linear map along one axis, the same for every other index: resizing, padding and pooling
// are such maps, and the adjoint of one is the map of the transposed matrix.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/parallel.h"
#include "nn/kernels/kernel_context.h"

namespace tilegrad::nn {

// A sparse matrix [out, in]: row i has the terms t with begin[i] <= t < begin[i + 1].
template <class T>
struct SparseRows {
  std::size_t in = 1, out = 1;
  const std::int32_t* begin = nullptr;  // [out + 1], not decreasing
  const std::int32_t* index = nullptr;  // [begin[out]], each in [0, in)
  const T* weight = nullptr;            // [begin[out]]
};

//   y[o, i, k] = sum_t weight[t] x[o, index[t], k]
// x [outer, in, inner], y [outer, out, inner]; sums run in the order of t.
template <class T>
struct AxisMapProblem {
  std::size_t outer = 1, inner = 1;
  SparseRows<T> map;
  const T* x = nullptr;
  T* y = nullptr;
};

void MapAxis(const AxisMapProblem<float>& problem, const Workers& workers);
void MapAxis(const AxisMapProblem<double>& problem, const Workers& workers);  // scalar

// The last two axes at once: y[o] = rows x[o] columns^T. x [outer, rows.in, columns.in], y [outer,
// rows.out, columns.out]; combines rows first.
template <class T>
struct ImageMapProblem {
  std::size_t outer = 1;
  SparseRows<T> rows, columns;
  const T* x = nullptr;
  T* y = nullptr;
};

void MapImage(const ImageMapProblem<float>& problem, const KernelContext& context);
void MapImage(const ImageMapProblem<double>& problem, const KernelContext& context);  // scalar

}  // namespace tilegrad::nn
