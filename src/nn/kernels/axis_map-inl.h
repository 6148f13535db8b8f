// SPDX-License-Identifier: Apache-2.0
// Vector body of axis_map.h: lanes run over the axes after the mapped one. The last axis, which has
// none after it, is a loop for each run of columns.

#include <hwy/highway.h>

#include <algorithm>
#include <span>

#include "nn/kernels/axis_map_ref.h"
#include "nn/kernels/vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Row i of `map`, applied to the rows of x [in, width].
HWY_INLINE void CombineRows(const SparseRows<float>& map, std::size_t i, std::size_t width,
                            const float* x, float* y) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t k = 0; k < width; k += lanes) {
    const std::size_t count = HWY_MIN(lanes, width - k);
    VF sum = hn::Zero(d);
    for (std::int32_t t = map.begin[i]; t < map.begin[i + 1]; ++t) {
      const float* from = x + static_cast<std::size_t>(map.index[t]) * width + k;
      sum = hn::MulAdd(hn::Set(d, map.weight[t]), LoadSome(d, from, count), sum);
    }
    StoreSome(sum, d, y + k, count);
  }
}

// Rows [first, last) of the outer * out rows of y.
void AxisMapRange(const AxisMapProblem<float>& p, std::size_t first, std::size_t last) {
  for (std::size_t row = first; row < last; ++row) {
    CombineRows(p.map, row % p.map.out, p.inner, p.x + row / p.map.out * p.map.in * p.inner,
                p.y + row * p.inner);
  }
}

// The row of x that row i of y copies; null if it combines several, or scales one.
HWY_INLINE const float* CopiedRow(const ImageMapProblem<float>& p, std::size_t i, const float* x) {
  const std::int32_t t = p.rows.begin[i];
  if (p.rows.begin[i + 1] != t + 1 || p.rows.weight[t] != 1.0f) return nullptr;
  return x + static_cast<std::size_t>(p.rows.index[t]) * p.columns.in;
}

// Columns [run.begin, run.end) of y.
HWY_INLINE void MapRun(const SparseRows<float>& columns, const ColumnRun& run,
                       const float* HWY_RESTRICT x, float* HWY_RESTRICT y) {
  const auto first = static_cast<std::size_t>(columns.begin[run.begin]);
  const std::int32_t* index = columns.index + first;
  const float* weight = columns.weight + first;
  const std::size_t count = run.end - run.begin;
  y += run.begin;
  if (run.copies) {
    std::copy_n(x + *index, count, y);
  } else if (run.terms == 1) {
    for (std::size_t j = 0; j < count; ++j) y[j] = weight[j] * x[index[j]];
  } else if (run.terms == 2) {
    for (std::size_t j = 0; j < count; ++j)
      y[j] = weight[2 * j] * x[index[2 * j]] + weight[2 * j + 1] * x[index[2 * j + 1]];
  } else {
    for (std::size_t j = 0, t = 0; j < count; ++j) {
      float sum = 0.0f;
      for (const std::size_t end = t + run.terms; t < end; ++t) sum += weight[t] * x[index[t]];
      y[j] = sum;
    }
  }
}

// x [.., in] -> y [.., out]: rows [first, last) of both.
void LastAxisRange(const AxisMapProblem<float>& p, std::span<const ColumnRun> runs,
                   std::size_t first, std::size_t last) {
  for (std::size_t o = first; o < last; ++o) {
    for (const ColumnRun& run : runs) MapRun(p.map, run, p.x + o * p.map.in, p.y + o * p.map.out);
  }
}

// Rows [first, last) of y; `combined`: scratch of columns.in numbers.
void ImageMapRange(const ImageMapProblem<float>& p, std::span<const ColumnRun> runs,
                   std::size_t first, std::size_t last, float* combined) {
  for (std::size_t row = first; row < last; ++row) {
    const std::size_t i = row % p.rows.out;
    const float* const plane = p.x + row / p.rows.out * p.rows.in * p.columns.in;
    const float* from = CopiedRow(p, i, plane);
    if (from == nullptr) {
      CombineRows(p.rows, i, p.columns.in, plane, combined);
      from = combined;
    }
    float* const to = p.y + row * p.columns.out;
    for (const ColumnRun& run : runs) MapRun(p.columns, run, from, to);
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
