// SPDX-License-Identifier: Apache-2.0
// Scalar reference of axis_map.h.
#pragma once

#include "nn/kernels/axis_map.h"

namespace tilegrad::nn {

// Rows [first, last) of the outer * out rows of y.
template <class T>
void AxisMapRef(const AxisMapProblem<T>& p, std::size_t first, std::size_t last) {
  std::size_t i = first % p.out;
  const T* x = p.x + first / p.out * p.in * p.inner;
  for (std::size_t row = first; row < last; ++row) {
    for (std::size_t k = 0; k < p.inner; ++k) {
      T sum{};
      for (std::int32_t t = p.begin[i]; t < p.begin[i + 1]; ++t) {
        sum += p.weight[t] * x[static_cast<std::size_t>(p.index[t]) * p.inner + k];
      }
      p.y[row * p.inner + k] = sum;
    }
    if (++i == p.out) {
      i = 0;
      x += p.in * p.inner;
    }
  }
}

}  // namespace tilegrad::nn
