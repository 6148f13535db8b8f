// SPDX-License-Identifier: Apache-2.0
#include "base/array_checks.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "base/array_checks.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace tilegrad::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Merges term(v) of all values v, with several independent accumulators.
template <class D, class Term, class Merge>
HWY_INLINE hn::Vec<D> MergeTerms(D d, std::span<const hn::TFromD<D>> values, const Term& term,
                                 const Merge& merge) {
  constexpr std::size_t kParts = 4;
  const std::size_t lanes = hn::Lanes(d), count = values.size();
  const hn::TFromD<D>* const from = values.data();
  hn::Vec<D> parts[kParts] = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  std::size_t i = 0;
  for (; i + kParts * lanes <= count; i += kParts * lanes) {
    for (std::size_t p = 0; p < kParts; ++p) {
      parts[p] = merge(parts[p], term(hn::LoadU(d, from + i + p * lanes)));
    }
  }
  for (; i + lanes <= count; i += lanes) parts[0] = merge(parts[0], term(hn::LoadU(d, from + i)));
  for (; i < count; ++i) parts[1] = merge(parts[1], term(hn::Set(d, from[i])));
  return merge(merge(parts[0], parts[1]), merge(parts[2], parts[3]));
}

// Sums of v * 0, which is NaN where v is not finite.
template <class T>
HWY_INLINE bool NoneIsInfiniteOrNan(std::span<const T> values) {
  const hn::ScalableTag<T> d;
  using V = hn::Vec<decltype(d)>;
  const V zero = hn::Zero(d);
  const V sum = MergeTerms(
      d, values, [&](V v) HWY_ATTR { return hn::Mul(v, zero); },
      [](V a, V b) HWY_ATTR { return hn::Add(a, b); });
  return hn::AllTrue(d, hn::Eq(sum, zero));
}
bool AllFiniteFloat(std::span<const float> values) { return NoneIsInfiniteOrNan(values); }
bool AllFiniteDouble(std::span<const double> values) { return NoneIsInfiniteOrNan(values); }

// NaN fails every comparison, so this accumulates which values passed.
template <class T>
HWY_INLINE bool NoneIsBeyond(std::span<const T> values, T most) {
  const hn::ScalableTag<T> d;
  using V = hn::Vec<decltype(d)>;
  const V limit = hn::Set(d, most), one = hn::Set(d, T(1)), zero = hn::Zero(d);
  const V beyond = MergeTerms(
      d, values, [&](V v) HWY_ATTR { return hn::IfThenElse(hn::Le(hn::Abs(v), limit), zero, one); },
      [](V a, V b) HWY_ATTR { return hn::Max(a, b); });
  return hn::AllTrue(d, hn::Eq(beyond, zero));
}
bool AllBelowFloat(std::span<const float> values, float most) { return NoneIsBeyond(values, most); }
bool AllBelowDouble(std::span<const double> values, double most) {
  return NoneIsBeyond(values, most);
}

bool AllWithinInt(std::span<const std::int32_t> values, std::int32_t least, std::int32_t end) {
  if (least >= end) return values.empty();
  const hn::ScalableTag<std::int32_t> d;
  using V = hn::Vec<decltype(d)>;
  const V low = hn::Set(d, least), last = hn::Set(d, end - 1);
  const V outside = MergeTerms(
      d, values,
      [&](V v) HWY_ATTR {
        return hn::Or(hn::VecFromMask(d, hn::Lt(v, low)), hn::VecFromMask(d, hn::Lt(last, v)));
      },
      [](V a, V b) HWY_ATTR { return hn::Or(a, b); });
  return hn::AllTrue(d, hn::Eq(outside, hn::Zero(d)));
}

}  // namespace tilegrad::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tilegrad {
namespace {
HWY_EXPORT(AllFiniteFloat);
HWY_EXPORT(AllFiniteDouble);
HWY_EXPORT(AllBelowFloat);
HWY_EXPORT(AllBelowDouble);
HWY_EXPORT(AllWithinInt);
}  // namespace

bool AllFinite(std::span<const float> values) {
  return HWY_DYNAMIC_DISPATCH(AllFiniteFloat)(values);
}
bool AllFinite(std::span<const double> values) {
  return HWY_DYNAMIC_DISPATCH(AllFiniteDouble)(values);
}
bool AllBelow(std::span<const float> values, float most) {
  return HWY_DYNAMIC_DISPATCH(AllBelowFloat)(values, most);
}
bool AllBelow(std::span<const double> values, double most) {
  return HWY_DYNAMIC_DISPATCH(AllBelowDouble)(values, most);
}
bool AllWithin(std::span<const std::int32_t> values, std::int32_t least, std::int32_t end) {
  return HWY_DYNAMIC_DISPATCH(AllWithinInt)(values, least, end);
}

}  // namespace tilegrad
#endif
