// SPDX-License-Identifier: Apache-2.0
// Scalar reference of mesh_normals.h. T: float, double, std::complex<double>. Sums over faces are a
// scatter, so the float version uses this code too.
#pragma once

#include <cstddef>
#include <limits>

#include "shade/mesh_normals.h"

namespace tilegrad::shade {

template <class T>
Vec3<T> PositionRef(const TriangleMeshT<T>& mesh, std::size_t face, std::size_t corner) {
  const T* p = &mesh.positions[3 * static_cast<std::size_t>(mesh.faces[3 * face + corner])];
  return {p[0], p[1], p[2]};
}

template <class T>
Vec3<T> FaceNormalRef(const TriangleMeshT<T>& mesh, std::size_t face) {
  const Vec3<T> a = PositionRef(mesh, face, 0);
  return Cross(Minus(PositionRef(mesh, face, 1), a), Minus(PositionRef(mesh, face, 2), a));
}

// d_positions += ...: with e1 = b - a, e2 = c - a, d_e1 = e2 x d_n and d_e2 = d_n x e1.
template <class T>
void FaceNormalAdjointRef(const TriangleMeshT<T>& mesh, std::size_t face, const Vec3<T>& d_normal,
                          std::span<T> d_positions) {
  const Vec3<T> a = PositionRef(mesh, face, 0);
  const Vec3<T> e1 = Minus(PositionRef(mesh, face, 1), a),
                e2 = Minus(PositionRef(mesh, face, 2), a);
  const Vec3<T> d_e1 = Cross(e2, d_normal), d_e2 = Cross(d_normal, e1);
  const auto to = [&](std::size_t k) {
    return &d_positions[3 * static_cast<std::size_t>(mesh.faces[3 * face + k])];
  };
  for (std::size_t i = 0; i < 3; ++i) {
    to(0)[i] -= d_e1[i] + d_e2[i];
    to(1)[i] += d_e1[i];
    to(2)[i] += d_e2[i];
  }
}

// The magnitude of the products whose differences form a face's normal: the normal's rounding is a
// few units in the last place of this, however thin the face is.
template <class T>
T NormalScaleRef(const TriangleMeshT<T>& mesh, std::size_t face) {
  const Vec3<T> a = PositionRef(mesh, face, 0);
  return T(LargestRef(Minus(PositionRef(mesh, face, 1), a)) *
           LargestRef(Minus(PositionRef(mesh, face, 2), a)));
}

// The direction of a sum of normals whose scales add up to `scale`. Cancellation leaves 7 half
// units of rounding per face, and one per addition; normals that do not cancel are as large as the
// scale.
template <class T>
UnitVector<T> DirectionOfSumRef(const Vec3<T>& sum, const T& scale) {
  using Real = decltype(RealPart(T()));
  const Real rounding = 16 * std::numeric_limits<Real>::epsilon() * RealPart(scale);
  return LargestRef(sum) > rounding ? NormalizeScaledRef(sum) : UnitVector<T>();
}

// units [V]
template <class T>
void SmoothNormalsRef(const TriangleMeshT<T>& mesh, std::span<UnitVector<T>> units) {
  for (auto& u : units) u = {};
  for (std::size_t f = 0; f < mesh.faces.size() / 3; ++f) {
    const Vec3<T> n = FaceNormalRef(mesh, f);
    const T scale = NormalScaleRef(mesh, f);
    for (std::size_t k = 0; k < 3; ++k) {
      auto& sum = units[static_cast<std::size_t>(mesh.faces[3 * f + k])];
      AddScaled(T(1), n, sum.unit);
      sum.inverse_length += scale;  // used as temporary until the sum is complete
    }
  }
  for (auto& u : units) u = DirectionOfSumRef(u.unit, u.inverse_length);
}

// units [F]
template <class T>
void FlatNormalsRef(const TriangleMeshT<T>& mesh, std::span<UnitVector<T>> units) {
  for (std::size_t f = 0; f < units.size(); ++f) {
    units[f] = NormalizeScaledRef(FaceNormalRef(mesh, f));
  }
}

// Turns d_units into gradients of the vectors before normalisation.
template <class T>
void UnitsAdjointRef(std::span<const UnitVector<T>> units, std::span<Vec3<T>> d_units) {
  for (std::size_t i = 0; i < units.size(); ++i) {
    Vec3<T> d_sum = {T(0), T(0), T(0)};
    NormalizeAdjointRef(units[i], d_units[i], d_sum);
    d_units[i] = d_sum;
  }
}

template <class T>
void SmoothNormalsAdjointRef(const TriangleMeshT<T>& mesh, std::span<const UnitVector<T>> units,
                             std::span<Vec3<T>> d_units, std::span<T> d_positions) {
  UnitsAdjointRef(units, d_units);
  for (std::size_t f = 0; f < mesh.faces.size() / 3; ++f) {
    Vec3<T> d_normal = {T(0), T(0), T(0)};
    for (std::size_t k = 0; k < 3; ++k) {
      AddScaled(T(1), d_units[static_cast<std::size_t>(mesh.faces[3 * f + k])], d_normal);
    }
    FaceNormalAdjointRef(mesh, f, d_normal, d_positions);
  }
}

template <class T>
void FlatNormalsAdjointRef(const TriangleMeshT<T>& mesh, std::span<const UnitVector<T>> units,
                           std::span<Vec3<T>> d_units, std::span<T> d_positions) {
  UnitsAdjointRef(units, d_units);
  for (std::size_t f = 0; f < units.size(); ++f) {
    FaceNormalAdjointRef(mesh, f, d_units[f], d_positions);
  }
}

}  // namespace tilegrad::shade
