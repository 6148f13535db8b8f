// SPDX-License-Identifier: Apache-2.0
// Vectors of three for the scalar references.
#pragma once

#include <array>
#include <cstddef>

namespace tilegrad::shade {

template <class T>
using Vec3 = std::array<T, 3>;

template <class T>
T Dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <class T>
Vec3<T> Cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <class T>
Vec3<T> Minus(const Vec3<T>& a, const Vec3<T>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

template <class T>
void AddScaled(const T& scale, const Vec3<T>& from, Vec3<T>& to) {
  for (std::size_t i = 0; i < 3; ++i) to[i] += scale * from[i];
}

}  // namespace tilegrad::shade
