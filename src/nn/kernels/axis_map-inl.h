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

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
