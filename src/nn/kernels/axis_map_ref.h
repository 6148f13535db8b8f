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

// Adjacent columns with equally many terms each; `copies`: x's neighbours, unchanged.
struct ColumnRun {
  std::size_t begin, end, terms;
  bool copies;
};

// Row `row` of the outer * rows.out rows of y; `combined`: scratch of columns.in numbers.
template <class T>
void ImageMapRowRef(const ImageMapProblem<T>& p, std::size_t row, T* combined) {
  const SparseRows<T>&rows = p.rows, &columns = p.columns;
  const std::size_t i = row % rows.out;
  const T* x = p.x + row / rows.out * rows.in * columns.in;
  for (std::size_t k = 0; k < columns.in; ++k) {
    T sum{};
    for (std::int32_t t = rows.begin[i]; t < rows.begin[i + 1]; ++t)
      sum += rows.weight[t] * x[static_cast<std::size_t>(rows.index[t]) * columns.in + k];
    combined[k] = sum;
  }
  for (std::size_t j = 0; j < columns.out; ++j) {
    T sum{};
    for (std::int32_t t = columns.begin[j]; t < columns.begin[j + 1]; ++t)
      sum += columns.weight[t] * combined[columns.index[t]];
    p.y[row * columns.out + j] = sum;
  }
}

}  // namespace tilegrad::nn
