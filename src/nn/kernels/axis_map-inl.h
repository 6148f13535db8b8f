// SPDX-License-Identifier: Apache-2.0
// Vector body of axis_map.h: lanes run over the axes after the mapped one. For the last axis, which
// has none after it, sums a row's few terms one by one.
#if defined(TILEGRAD_NN_AXIS_MAP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_AXIS_MAP_INL_H_
#undef TILEGRAD_NN_AXIS_MAP_INL_H_
#else
#define TILEGRAD_NN_AXIS_MAP_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <span>

#include "nn/kernels/axis_map_ref.h"
#include "nn/kernels/vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// One row of y if inner > 1.
HWY_INLINE void MapLongRow(const AxisMapProblem<float>& p, std::size_t row) {
  const DF d;
  const std::size_t i = row % p.out, lanes = hn::Lanes(d);
  const float* x = p.x + row / p.out * p.in * p.inner;
  for (std::size_t k = 0; k < p.inner; k += lanes) {
    const std::size_t count = HWY_MIN(lanes, p.inner - k);
    VF sum = hn::Zero(d);
    for (std::int32_t t = p.begin[i]; t < p.begin[i + 1]; ++t) {
      const float* from = x + static_cast<std::size_t>(p.index[t]) * p.inner + k;
      sum = hn::MulAdd(hn::Set(d, p.weight[t]), LoadSome(d, from, count), sum);
    }
    StoreSome(sum, d, p.y + row * p.inner + k, count);
  }
}

// Rows of y if inner is 1 and each has one term, as in a nearest resize: copies numbers.
HWY_INLINE void MapPoints(const AxisMapProblem<float>& p, std::size_t first, std::size_t last) {
  while (first < last) {
    const std::size_t i = first % p.out, count = HWY_MIN(p.out - i, last - first);
    const float* x = p.x + first / p.out * p.in;
    float* y = p.y + first;
    for (std::size_t k = 0; k < count; ++k) y[k] = 0.0f + p.weight[i + k] * x[p.index[i + k]];
    first += count;
  }
}

// Whether each row has one term.
HWY_INLINE bool OneTermEach(const AxisMapProblem<float>& p) {
  for (std::size_t i = 0; i <= p.out; ++i) {
    if (p.begin[i] != static_cast<std::int32_t>(i)) return false;
  }
  return true;
}

// Rows [first, last) of y.
void AxisMapRange(const AxisMapProblem<float>& p, std::size_t first, std::size_t last) {
  if (p.inner == 1 && OneTermEach(p)) return MapPoints(p, first, last);
  if (p.inner == 1) return AxisMapRef(p, first, last);
  for (std::size_t row = first; row < last; ++row) MapLongRow(p, row);
}

// The row of x that row i of y copies; null if it combines several, or scales one.
HWY_INLINE const float* CopiedRow(const ImageMapProblem<float>& p, std::size_t i, const float* x) {
  const std::int32_t t = p.rows.begin[i];
  if (p.rows.begin[i + 1] != t + 1 || p.rows.weight[t] != 1.0f) return nullptr;
  return x + static_cast<std::size_t>(p.rows.index[t]) * p.columns.in;
}

HWY_INLINE void CombineRows(const ImageMapProblem<float>& p, std::size_t i, const float* x,
                            float* combined) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d), width = p.columns.in;
  for (std::size_t k = 0; k < width; k += lanes) {
    const std::size_t count = HWY_MIN(lanes, width - k);
    VF sum = hn::Zero(d);
    for (std::int32_t t = p.rows.begin[i]; t < p.rows.begin[i + 1]; ++t) {
      const float* from = x + static_cast<std::size_t>(p.rows.index[t]) * width + k;
      sum = hn::MulAdd(hn::Set(d, p.rows.weight[t]), LoadSome(d, from, count), sum);
    }
    StoreSome(sum, d, combined + k, count);
  }
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

// Rows [first, last) of y; `combined`: scratch of columns.in numbers.
void ImageMapRange(const ImageMapProblem<float>& p, std::span<const ColumnRun> runs,
                   std::size_t first, std::size_t last, float* combined) {
  for (std::size_t row = first; row < last; ++row) {
    const std::size_t i = row % p.rows.out;
    const float* const plane = p.x + row / p.rows.out * p.rows.in * p.columns.in;
    const float* from = CopiedRow(p, i, plane);
    if (from == nullptr) {
      CombineRows(p, i, plane, combined);
      from = combined;
    }
    float* const to = p.y + row * p.columns.out;
    for (const ColumnRun& run : runs) MapRun(p.columns, run, from, to);
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
