// SPDX-License-Identifier: Apache-2.0
// Vector body of reduce.h. Where the last axis is reduced, lanes run along it; where it is kept,
// each lane sums an output of its own.
#if defined(TILEGRAD_NN_REDUCE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_REDUCE_INL_H_
#undef TILEGRAD_NN_REDUCE_INL_H_
#else
#define TILEGRAD_NN_REDUCE_INL_H_
#endif

#include <hwy/highway.h>

#include "nn/kernels/reduce_ref.h"
#include "nn/kernels/vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Four independent sums hide the latency of the addition (4 cycles, 2 a cycle on AVX2 machines).
struct RowSum {
  DF d;
  VF s0, s1, s2, s3;

  // Written out: a default member initialiser would not be compiled for the target.
  HWY_INLINE explicit RowSum(DF tag)
      : s0(hn::Zero(tag)), s1(hn::Zero(tag)), s2(hn::Zero(tag)), s3(hn::Zero(tag)) {}

  HWY_INLINE void AddRow(const float* x, std::size_t n) {
    const std::size_t lanes = hn::Lanes(d);
    std::size_t i = 0;
    for (; i + 4 * lanes <= n; i += 4 * lanes) {
      s0 = hn::Add(s0, hn::LoadU(d, x + i));
      s1 = hn::Add(s1, hn::LoadU(d, x + i + lanes));
      s2 = hn::Add(s2, hn::LoadU(d, x + i + 2 * lanes));
      s3 = hn::Add(s3, hn::LoadU(d, x + i + 3 * lanes));
    }
    for (; i + lanes <= n; i += lanes) s0 = hn::Add(s0, hn::LoadU(d, x + i));
    if (i < n) s1 = hn::Add(s1, LoadTail(d, x + i, n - i));
  }
  HWY_INLINE float Total() const { return SumLanes(d, hn::Add(hn::Add(s0, s1), hn::Add(s2, s3))); }
};

// Outputs [begin, end); the last axis is reduced.
void SumAlongRows(const ReduceLayout& l, const float* x, float* y, std::size_t begin,
                  std::size_t end) {
  for (std::size_t o = begin; o < end; ++o) {
    const ReduceAddress address = AddressOf(l, o);
    RowSum sum{DF()};
    for (std::size_t a = 0; a < l.reduced[0]; ++a) {
      for (std::size_t b = 0; b < l.reduced[1]; ++b) {
        sum.AddRow(x + address.base + a * address.steps[0] + b * address.steps[1], l.reduced[2]);
      }
    }
    y[o] = sum.Total();
  }
}

// Outputs [begin, end), which share k0 and k1; the last axis is kept: r2 = 1.
void SumColumns(const ReduceLayout& l, const float* x, float* y, std::size_t begin,
                std::size_t end) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t o = begin; o < end; o += lanes) {
    const ReduceAddress address = AddressOf(l, o);
    const std::size_t count = HWY_MIN(lanes, end - o);
    VF sum = hn::Zero(d);
    for (std::size_t a = 0; a < l.reduced[0]; ++a) {
      for (std::size_t b = 0; b < l.reduced[1]; ++b) {
        const float* from = x + address.base + a * address.steps[0] + b * address.steps[1];
        sum = hn::Add(sum, count == lanes ? hn::LoadU(d, from) : LoadTail(d, from, count));
      }
    }
    if (count == lanes) {
      hn::StoreU(sum, d, y + o);
    } else {
      StoreTail(sum, d, y + o, count);
    }
  }
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
