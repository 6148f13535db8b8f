// SPDX-License-Identifier: Apache-2.0
// Barycentric weights of a face as linear functions of the screen position (paper, equations 2, 3).
// Scalar template, shared by references and set-up code.
#pragma once

#include <array>
#include <cstddef>

#include "raster/conventions.h"
#include "raster/scalar.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// b_k(p) = base[k] + gx[k] * (p.x - x0) + gy[k] * (p.y - y0); the three sum to 1. A face thinner
// than kFlatHeight has constant weights 1/3 (conventions.h, rule 8).
template <class T>
struct FacePlane {
  T x0, y0;
  T base[3], gx[3], gy[3];

  std::array<T, 3> Weights(const T& px, const T& py) const {
    const T dx = px - x0, dy = py - y0;
    return {base[0] + gx[0] * dx + gy[0] * dy, base[1] + gx[1] * dx + gy[1] * dy,
            base[2] + gx[2] * dx + gy[2] * dy};
  }
};

// (x1, y1), (x2, y2): corners 1 and 2 relative to corner 0; area: their cross product.
template <class T>
bool IsSliver(T x1, T y1, T x2, T y2, T area) {
  const T x3 = x2 - x1, y3 = y2 - y1;
  T longest = x1 * x1 + y1 * y1;
  const T second = x2 * x2 + y2 * y2, third = x3 * x3 + y3 * y3;
  longest = longest < second ? second : longest;
  longest = longest < third ? third : longest;
  return !(area * area > T(kFlatHeight * kFlatHeight) * longest);  // height = |area| / longest edge
}

template <class T>
FacePlane<T> MakeFacePlane(const ScreenMeshT<T>& mesh, std::size_t face) {
  const auto a = static_cast<std::size_t>(mesh.v0[face]);
  const auto b = static_cast<std::size_t>(mesh.v1[face]);
  const auto c = static_cast<std::size_t>(mesh.v2[face]);
  const T x1 = mesh.x[b] - mesh.x[a], y1 = mesh.y[b] - mesh.y[a];
  const T x2 = mesh.x[c] - mesh.x[a], y2 = mesh.y[c] - mesh.y[a];
  const T area = x1 * y2 - x2 * y1;
  FacePlane<T> plane{mesh.x[a], mesh.y[a], {T(1), T(0), T(0)}, {}, {}};
  if (IsSliver(RealPart(x1), RealPart(y1), RealPart(x2), RealPart(y2), RealPart(area))) {
    for (T& weight : plane.base) weight = T(1) / T(3);
    return plane;
  }
  const T inverse = T(1) / area;
  plane.gx[1] = y2 * inverse, plane.gy[1] = -x2 * inverse;
  plane.gx[2] = -y1 * inverse, plane.gy[2] = x1 * inverse;
  plane.gx[0] = -(plane.gx[1] + plane.gx[2]), plane.gy[0] = -(plane.gy[1] + plane.gy[2]);
  return plane;
}

// 1/depth over a face; linear on the screen, kept between the values of the corners, which rounding
// of a sliver would leave.
template <class T>
struct DepthPlane {
  T x0, y0, base, gx, gy;
  T low, high;

  T At(const T& px, const T& py) const {
    const T value = base + (gx * (px - x0) + gy * (py - y0));
    if (RealPart(value) < RealPart(low)) return low;
    return RealPart(value) > RealPart(high) ? high : value;
  }
};

template <class T>
DepthPlane<T> MakeDepthPlane(const ScreenMeshT<T>& mesh, std::size_t face) {
  const FacePlane<T> weights = MakeFacePlane(mesh, face);
  DepthPlane<T> plane{weights.x0, weights.y0, T(0), T(0), T(0), T(0), T(0)};
  for (int k = 0; k < 3; ++k) {
    const T z = mesh.inverse_depth[static_cast<std::size_t>(mesh.vertex(face, k))];
    plane.base += weights.base[k] * z;
    plane.gx += weights.gx[k] * z, plane.gy += weights.gy[k] * z;
    if (k == 0 || RealPart(z) < RealPart(plane.low)) plane.low = z;
    if (k == 0 || RealPart(z) > RealPart(plane.high)) plane.high = z;
  }
  return plane;
}

}  // namespace tilegrad::raster
