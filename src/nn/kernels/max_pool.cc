// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/max_pool.h"

#include <algorithm>

namespace tilegrad::nn {
namespace {

struct Range {
  std::size_t begin, end;
};

// The part of an axis of `extent` elements that window i covers.
Range Window(const PoolShape& s, std::size_t i, std::size_t extent) {
  const std::size_t from = i * s.stride;  // in the padded axis
  return {from > s.padding ? from - s.padding : 0, std::min(extent, from + s.kernel - s.padding)};
}

template <class T>
std::int32_t Largest(const PoolShape& s, const T* x, const Range& rows, const Range& columns) {
  std::size_t best = rows.begin * s.width + columns.begin;
  for (std::size_t r = rows.begin; r < rows.end; ++r) {
    for (std::size_t k = r * s.width + columns.begin; k < r * s.width + columns.end; ++k) {
      if (x[k] > x[best] || (x[k] != x[k] && x[best] == x[best])) best = k;
    }
  }
  return static_cast<std::int32_t>(best);
}

template <class T>
void Indices(const PoolShape& s, const T* x, std::int32_t* first, const Workers& workers) {
  workers.For(s.planes * s.out_height, [&](std::size_t row, std::size_t) {
    const T* plane = x + row / s.out_height * s.height * s.width;
    const Range rows = Window(s, row % s.out_height, s.height);
    for (std::size_t j = 0; j < s.out_width; ++j) {
      first[row * s.out_width + j] = Largest(s, plane, rows, Window(s, j, s.width));
    }
  });
}

}  // namespace

void MaxPoolIndices(const PoolShape& shape, const float* x, std::int32_t* first,
                    const Workers& workers) {
  Indices(shape, x, first, workers);
}

void MaxPoolIndices(const PoolShape& shape, const double* x, std::int32_t* first,
                    const Workers& workers) {
  Indices(shape, x, first, workers);
}

}  // namespace tilegrad::nn
