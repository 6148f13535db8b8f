// SPDX-License-Identifier: Apache-2.0
// Points in double precision.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace tilegrad::train::points3 {

using Point = std::array<double, 3>;

inline Point operator+(const Point& a, const Point& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Point operator-(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Point operator*(double s, const Point& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double Dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Point Cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Point Unit(const Point& a) { return (1 / std::sqrt(std::max(Dot(a, a), 1e-300))) * a; }

}  // namespace tilegrad::train::points3
