// SPDX-License-Identifier: Apache-2.0
// Converts floating-point numbers to integers, with saturation. static_cast is undefined for NaN
// and for numbers that the type cannot hold, so such an index could point anywhere; this is defined
// for all.
#pragma once

#include <concepts>
#include <limits>

namespace tilegrad {

// `x` truncated and clamped to the range of the type; NaN becomes 0.
template <std::integral Whole, std::floating_point Real>
constexpr Whole WholeNumber(Real x) {
  using Range = std::numeric_limits<Whole>;
  if (x != x) return 0;
  // Real may not represent the maximum, which then rounds up to the next power of two.
  if (x >= static_cast<Real>(Range::max())) return Range::max();
  if (x <= static_cast<Real>(Range::min())) return Range::min();
  return static_cast<Whole>(x);
}

}  // namespace tilegrad
