// SPDX-License-Identifier: Apache-2.0
// Scalar reference of spherical_harmonics.h, and the basis. T: float, double, std::complex<double>.
#pragma once

#include <span>

#include "base/scalar.h"
#include "shade/spherical_harmonics.h"
#include "shade/vec3_ref.h"

namespace tilegrad::shade {

// Coefficient i adds kShValues[i] times monomial kShTerms[i] to the polynomial; that of 3z^2 - 1
// also adds kShConstant to its term 0. Before them: sqrt(1 / 4 pi), sqrt(3 / 4 pi), sqrt(15 / 4
// pi), sqrt(5 / 16 pi).
inline constexpr double kSh0 = 0.28209479177387814, kSh1 = 0.48860251190291992,
                        kSh2 = 1.0925484305920792, kSh3 = 0.31539156525252005;
inline constexpr double kShValues[9] = {kSh0,  -kSh1,    kSh1,  -kSh1,   kSh2,
                                        -kSh2, 3 * kSh3, -kSh2, kSh2 / 2};
inline constexpr std::size_t kShTerms[9] = {0, 2, 3, 1, 4, 5, 6, 7, 8};  // 1, y, z, x, ...
inline constexpr double kShConstant = -kSh3;

template <class T>
ShPolynomialT<T> ShPolynomialOf(std::span<const T> coefficients) {
  ShPolynomialT<T> out = {};
  for (std::size_t i = 0; i < 9; ++i) out[kShTerms[i]] += T(kShValues[i]) * coefficients[i];
  out[0] += T(kShConstant) * coefficients[6];
  return out;
}

// Adds to d_coefficients[9].
template <class T>
void ShPolynomialAdjoint(const ShPolynomialT<T>& d_polynomial, std::span<T> d_coefficients) {
  for (std::size_t i = 0; i < 9; ++i) {
    d_coefficients[i] += T(kShValues[i]) * d_polynomial[kShTerms[i]];
  }
  d_coefficients[6] += T(kShConstant) * d_polynomial[0];
}

template <class T>
bool HasDirection(const Vec3<T>& n) {
  return RealPart(n[0]) != 0 || RealPart(n[1]) != 0 || RealPart(n[2]) != 0;
}

template <class T>
std::array<T, 9> ShMonomials(const Vec3<T>& n) {
  const T &x = n[0], &y = n[1], &z = n[2];
  return {T(1), x, y, z, x * y, y * z, z * z, x * z, x * x - y * y};
}

template <class T>
T ShLightRef(const ShPolynomialT<T>& p, const Vec3<T>& n) {
  if (!HasDirection(n)) return T(0);
  const std::array<T, 9> m = ShMonomials(n);
  T sum = T(0);
  for (std::size_t i = 0; i < 9; ++i) sum += p[i] * m[i];
  return sum;
}

// Adds to d_p and d_n.
template <class T>
void ShLightAdjointRef(const ShPolynomialT<T>& p, const Vec3<T>& n, const T& d_light,
                       ShPolynomialT<T>& d_p, Vec3<T>& d_n) {
  if (!HasDirection(n)) return;
  const std::array<T, 9> m = ShMonomials(n);
  for (std::size_t i = 0; i < 9; ++i) d_p[i] += d_light * m[i];
  const T &x = n[0], &y = n[1], &z = n[2];
  d_n[0] += d_light * (p[1] + p[4] * y + p[7] * z + T(2) * p[8] * x);
  d_n[1] += d_light * (p[2] + p[4] * x + p[5] * z - T(2) * p[8] * y);
  d_n[2] += d_light * (p[3] + p[5] * y + T(2) * p[6] * z + p[7] * x);
}

}  // namespace tilegrad::shade
