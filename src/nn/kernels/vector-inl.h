// SPDX-License-Identifier: Apache-2.0
// What the vector bodies of this folder share: the float vector, tails, and sums in a fixed order.
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

// The first `count` < Lanes(d) numbers; the other lanes are 0. Never touches what lies beyond.
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

HWY_INLINE float SumLanes(DF d, VF v) { return hn::GetLane(hn::SumOfLanes(d, v)); }

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
