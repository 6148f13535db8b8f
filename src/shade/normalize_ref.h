// SPDX-License-Identifier: Apache-2.0
// Scalar reference of normalize.h. T: float, double, std::complex<double>.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/scalar.h"
#include "shade/normalize.h"
#include "shade/vec3_ref.h"

namespace tilegrad::shade {

template <class T>
struct UnitVector {
  Vec3<T> unit = {T(0), T(0), T(0)};
  T inverse_length = T(0);  // 0: no direction
};

template <class T>
UnitVector<T> NormalizeRef(const Vec3<T>& x, float least) {
  using std::sqrt;
  const T square = Dot(x, x);
  if (!(RealPart(square) > least)) return {};
  const T inverse = T(1) / sqrt(square);
  return {{x[0] * inverse, x[1] * inverse, x[2] * inverse}, inverse};
}

template <class T>
auto LargestRef(const Vec3<T>& x) {
  return std::max({std::abs(RealPart(x[0])), std::abs(RealPart(x[1])), std::abs(RealPart(x[2]))});
}

// The same for vectors of any scale: only a vector whose components are all at most kLeastComponent
// has no direction.
template <class T>
UnitVector<T> NormalizeScaledRef(const Vec3<T>& x) {
  const auto scale = LargestRef(x);
  if (!(scale > kLeastComponent) || !std::isfinite(scale)) return {};
  // Scaling by a constant changes neither the direction nor its derivative.
  const T s = T(1) / T(scale);
  UnitVector<T> out = NormalizeRef<T>({x[0] * s, x[1] * s, x[2] * s}, 0);
  out.inverse_length *= s;
  return out;
}

// Adds to d_x.
template <class T>
void NormalizeAdjointRef(const UnitVector<T>& u, const Vec3<T>& d_unit, Vec3<T>& d_x) {
  const T along = Dot(u.unit, d_unit);
  for (std::size_t i = 0; i < 3; ++i) {
    d_x[i] += u.inverse_length * (d_unit[i] - u.unit[i] * along);
  }
}

}  // namespace tilegrad::shade
