// SPDX-License-Identifier: Apache-2.0
// Scalar reference of axis_map.h.
#pragma once

#include "nn/kernels/axis_map.h"

namespace tilegrad::nn {

// Row i of `map`, applied to the rows of x [in, width].
template <class T>
void CombineRowsRef(const SparseRows<T>& map, std::size_t i, std::size_t width, const T* x, T* y) {
  for (std::size_t k = 0; k < width; ++k) {
    T sum{};
    for (std::int32_t t = map.begin[i]; t < map.begin[i + 1]; ++t)
      sum += map.weight[t] * x[static_cast<std::size_t>(map.index[t]) * width + k];
    y[k] = sum;
  }
}

// Rows [first, last) of the outer * out rows of y.
template <class T>
void AxisMapRef(const AxisMapProblem<T>& p, std::size_t first, std::size_t last) {
  for (std::size_t row = first; row < last; ++row) {
    CombineRowsRef(p.map, row % p.map.out, p.inner, p.x + row / p.map.out * p.map.in * p.inner,
                   p.y + row * p.inner);
  }
}

// Row `row` of the outer * rows.out rows of y; `combined`: scratch of columns.in numbers.
template <class T>
void ImageMapRowRef(const ImageMapProblem<T>& p, std::size_t row, T* combined) {
  const std::size_t width = p.columns.in;
  CombineRowsRef(p.rows, row % p.rows.out, width, p.x + row / p.rows.out * p.rows.in * width,
                 combined);
  for (std::size_t j = 0; j < p.columns.out; ++j)
    CombineRowsRef(p.columns, j, 1, combined, p.y + row * p.columns.out + j);
}

// For the vector body: adjacent columns with equally many terms each; `copies`: x's neighbours,
// unchanged.
struct ColumnRun {
  std::size_t begin, end, terms;
  bool copies;
};

}  // namespace tilegrad::nn
