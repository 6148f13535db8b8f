// SPDX-License-Identifier: Apache-2.0
// Shared by the vector bodies of this folder: the float vector, tails, sums in fixed order.
#if defined(TILEGRAD_NN_VECTOR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_NN_VECTOR_INL_H_
#undef TILEGRAD_NN_VECTOR_INL_H_
#else
#define TILEGRAD_NN_VECTOR_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using DF = hn::ScalableTag<float>;
using VF = hn::Vec<DF>;

// The first `count` < Lanes(d) numbers; the other lanes are 0. Never touches memory beyond.
HWY_INLINE VF LoadTail(DF d, const float* from, std::size_t count) {
  HWY_ALIGN float lanes[hn::MaxLanes(DF())] = {};
  for (std::size_t i = 0; i < count; ++i) lanes[i] = from[i];
  return hn::Load(d, lanes);
}

HWY_INLINE void StoreTail(VF v, DF d, float* to, std::size_t count) {
  HWY_ALIGN float lanes[hn::MaxLanes(DF())];
  hn::Store(v, d, lanes);
  for (std::size_t i = 0; i < count; ++i) to[i] = lanes[i];
}

// A whole vector or, if count < Lanes(d), a tail.
HWY_INLINE VF LoadSome(DF d, const float* from, std::size_t count) {
  return HWY_LIKELY(count >= hn::Lanes(d)) ? hn::LoadU(d, from) : LoadTail(d, from, count);
}

HWY_INLINE void StoreSome(VF v, DF d, float* to, std::size_t count) {
  if (HWY_LIKELY(count >= hn::Lanes(d))) {
    hn::StoreU(v, d, to);
  } else {
    StoreTail(v, d, to, count);
  }
}

HWY_INLINE float SumLanes(DF d, VF v) { return hn::GetLane(hn::SumOfLanes(d, v)); }

// Four independent sums hide the latency of addition (4 cycles, 2 per cycle on AVX2 machines).
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

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
