// SPDX-License-Identifier: Apache-2.0
// A number that carries a bound on the error of the same computation in float: running error
// analysis (Higham, Accuracy and Stability of Numerical Algorithms, 3.3). The references of raster
// and render are templates over their number type, so that run on these they state their own
// tolerance.
#pragma once

#include <cmath>
#include <limits>

namespace tilegrad::test {

struct Bounded {
  double value = 0, error = 0;

  Bounded() = default;
  Bounded(double v) : value(v) {}  // exact; implicit, as a conversion between numbers is
  Bounded(double v, double e) : value(v), error(e) {}

  Bounded operator-() const { return {-value, error}; }
  inline Bounded& operator+=(const Bounded& b);
  inline Bounded& operator-=(const Bounded& b);
  inline Bounded& operator*=(const Bounded& b);
  inline Bounded& operator/=(const Bounded& b);
};

inline constexpr double kUnitRoundoff = 0x1p-24;
inline constexpr double kUnderflow = 0x1p-149;
// Another order of the same operations may meet intermediate values larger by this much.
inline constexpr double kMayOverflow = 0x1p128 * 0x1p-24;

// The result of one operation whose operands were off by enough to move it by `error`. `size`:
// what its rounding is relative to.
inline Bounded Rounded(double value, double error, double size) {
  const Bounded out{value, error + kUnitRoundoff * size + kUnderflow};
  if (std::abs(value) + out.error < kMayOverflow) return out;  // false for NaN
  return {std::isfinite(value) ? value : 0, std::numeric_limits<double>::infinity()};
}

// Sums are rounded relative to their terms, not their value, so that the order does not matter.
inline Bounded operator+(const Bounded& a, const Bounded& b) {
  return Rounded(a.value + b.value, a.error + b.error, std::abs(a.value) + std::abs(b.value));
}
inline Bounded operator-(const Bounded& a, const Bounded& b) { return a + -b; }
inline Bounded operator*(const Bounded& a, const Bounded& b) {
  const double value = a.value * b.value;
  return Rounded(value,
                 std::abs(a.value) * b.error + std::abs(b.value) * a.error + a.error * b.error,
                 std::abs(value));
}
inline Bounded operator/(const Bounded& a, const Bounded& b) {
  const double least = std::abs(b.value) - b.error, value = a.value / b.value;
  if (!(least > 0)) return {0, std::numeric_limits<double>::infinity()};
  return Rounded(value, (a.error + std::abs(value) * b.error) / least, std::abs(value));
}
// Decisions are taken on the value.
inline bool operator<(const Bounded& a, const Bounded& b) { return a.value < b.value; }
inline bool operator>(const Bounded& a, const Bounded& b) { return a.value > b.value; }
inline bool operator>=(const Bounded& a, const Bounded& b) { return a.value >= b.value; }
inline bool operator==(const Bounded& a, const Bounded& b) { return a.value == b.value; }

inline Bounded& Bounded::operator+=(const Bounded& b) { return *this = *this + b; }
inline Bounded& Bounded::operator-=(const Bounded& b) { return *this = *this - b; }
inline Bounded& Bounded::operator*=(const Bounded& b) { return *this = *this * b; }
inline Bounded& Bounded::operator/=(const Bounded& b) { return *this = *this / b; }

}  // namespace tilegrad::test
