// SPDX-License-Identifier: Apache-2.0
// The truth of spherical_harmonics.h, and the bases. T: float, double, std::complex<double>.
#pragma once

#include <cstddef>
#include <numbers>
#include <span>

#include "base/scalar.h"
#include "shade/spherical_harmonics.h"
#include "shade/vec3_ref.h"

namespace tilegrad::shade {

// Coefficient i adds value[i] times monomial term[i] to the polynomial; that of 3z^2 - 1 also adds
// `constant` to its term 0.
struct ShTable {
  std::array<double, 9> value;
  std::array<std::size_t, 9> term;
  double constant;
};

inline ShTable ShTableOf(ShBasis basis) {
  constexpr std::array<std::size_t, 9> kOrder = {0, 2, 3, 1, 4, 5, 6, 7, 8};  // 1, y, z, x, ...
  // sqrt(1 / 4 pi), sqrt(3 / 4 pi), sqrt(15 / 4 pi), sqrt(5 / 16 pi)
  constexpr double k0 = 0.28209479177387814, k1 = 0.48860251190291992, k2 = 1.0925484305920792,
                   k3 = 0.31539156525252005;
  switch (basis) {
    case ShBasis::kKaolin01:
      return {{0.2820948, -0.3257350, 0.3257350, -0.3257350, 0.2731371, -0.2731371, 0.1365686,
               -0.1931371, 0.1365686},
              kOrder,
              -0.0788479};
    case ShBasis::kKaolinLegacy:
      return {{0.28209479177, 0.4886025119, 0.4886025119, 0.4886025119, 1.09254843059,
               1.09254843059, 0.94617469575, 0.77254840404, 0.38627420202},
              {0, 1, 3, 2, 4, 5, 6, 7, 8},
              -0.31539156525};
    default:
      break;
  }
  ShTable out{{k0, -k1, k1, -k1, k2, -k2, 3 * k3, -k2, k2 / 2}, kOrder, -k3};
  if (basis == ShBasis::kOrthonormal) return out;
  constexpr double kPi = std::numbers::pi;
  for (std::size_t i = 0; i < 9; ++i) {
    out.value[i] *= i == 0 ? kPi : i < 4 ? 2 * kPi / 3 : kPi / 4;
  }
  out.constant *= kPi / 4;
  return out;
}

template <class T>
ShPolynomialT<T> ShPolynomialOf(ShBasis basis, std::span<const T> coefficients) {
  const ShTable table = ShTableOf(basis);
  ShPolynomialT<T> out = {};
  for (std::size_t i = 0; i < 9; ++i) out[table.term[i]] += T(table.value[i]) * coefficients[i];
  out[0] += T(table.constant) * coefficients[6];
  return out;
}

// Adds to d_coefficients[9].
template <class T>
void ShPolynomialAdjoint(ShBasis basis, const ShPolynomialT<T>& d_polynomial,
                         std::span<T> d_coefficients) {
  const ShTable table = ShTableOf(basis);
  for (std::size_t i = 0; i < 9; ++i) {
    d_coefficients[i] += T(table.value[i]) * d_polynomial[table.term[i]];
  }
  d_coefficients[6] += T(table.constant) * d_polynomial[0];
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
