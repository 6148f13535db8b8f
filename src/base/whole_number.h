// SPDX-License-Identifier: Apache-2.0
// Real numbers as whole ones. static_cast leaves undefined what becomes of NaN and of numbers that
// the type cannot hold, and an index or a size of that kind is anywhere; here each has its value.
#pragma once

#include <concepts>
#include <limits>

namespace tilegrad {

// `x` without its fraction, or the end of the type's range that it lies beyond; NaN becomes 0.
template <std::integral Whole, std::floating_point Real>
constexpr Whole WholeNumber(Real x) {
  using Range = std::numeric_limits<Whole>;
  if (x != x) return 0;
  // The upper end may not be a number of type Real, which then has the next power of two.
  if (x >= static_cast<Real>(Range::max())) return Range::max();
  if (x <= static_cast<Real>(Range::min())) return Range::min();
  return static_cast<Whole>(x);
}

}  // namespace tilegrad
