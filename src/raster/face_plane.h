// SPDX-License-Identifier: Apache-2.0
// Barycentric weights of a face as linear functions of the screen position (paper, equations 2, 3).
// Scalar template, shared by references and set-up code.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include "base/scalar.h"
#include "raster/conventions.h"
#include "raster/coverage.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Faces whose 1/depth varies by more than this factor lose digits at their far end, which is the
// one that the image shows, unless planes start there (FarCorner) and are set up in double: a face
// clipped at the near plane, say.
inline constexpr float kSteepDepth = 8;

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

// The square of the longest edge; (x1, y1), (x2, y2): corners 1 and 2 relative to corner 0.
template <class T>
T LongestSquared(T x1, T y1, T x2, T y2) {
  const T x3 = x2 - x1, y3 = y2 - y1;
  const T first = x1 * x1 + y1 * y1, second = x2 * x2 + y2 * y2, third = x3 * x3 + y3 * y3;
  return std::max({first, second, third});
}

// area: the cross product of corners 1 and 2.
template <class T>
bool IsSliver(T x1, T y1, T x2, T y2, T area) {
  const T longest = LongestSquared(x1, y1, x2, y2);
  return !(area * area > T(kFlatHeight * kFlatHeight) * longest);  // height = |area| / longest edge
}

// The corners of a face on the screen; z = 1/depth.
template <class T>
struct ScreenCorners {
  T x[3], y[3], z[3];
};

template <class T>
ScreenCorners<T> CornersOf(const ScreenMeshT<T>& mesh, std::size_t face) {
  ScreenCorners<T> out;
  for (int k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(mesh.vertex(face, k));
    out.x[k] = mesh.x[v];
    out.y[k] = mesh.y[v];
    out.z[k] = mesh.inverse_depth[v];
  }
  return out;
}

// The same in double, for small differences of large products.
template <class T>
ScreenCorners<double> Wide(const ScreenCorners<T>& c) {
  ScreenCorners<double> out;
  for (int k = 0; k < 3; ++k) {
    out.x[k] = RealPart(c.x[k]);
    out.y[k] = RealPart(c.y[k]);
    out.z[k] = RealPart(c.z[k]);
  }
  return out;
}

// The corner where a plane over the face starts: of a steep face the farthest, of others the first.
// Its near corners lie up to far / near times farther out, and weigh that much more in 1/depth.
template <class T>
int FarCorner(const ScreenCorners<T>& c) {
  int least = 0, largest = 0;
  for (int k = 1; k < 3; ++k) {
    if (RealPart(c.z[k]) < RealPart(c.z[least])) least = k;
    if (RealPart(c.z[k]) > RealPart(c.z[largest])) largest = k;
  }
  return RealPart(c.z[least] * T(kSteepDepth)) < RealPart(c.z[largest]) ? least : 0;
}

// Constant weights.
template <class T>
FacePlane<T> FlatPlane(const ScreenCorners<T>& c) {
  const T third = T(1) / T(3);
  return {c.x[0], c.y[0], {third, third, third}, {}, {}};
}

// Flat if the face is thin.
template <class T>
FacePlane<T> MakeFacePlane(const ScreenCorners<T>& c, int k0) {
  const int k1 = (k0 + 1) % 3, k2 = (k0 + 2) % 3;
  const T x1 = c.x[k1] - c.x[k0], y1 = c.y[k1] - c.y[k0];
  const T x2 = c.x[k2] - c.x[k0], y2 = c.y[k2] - c.y[k0];
  const T area = x1 * y2 - x2 * y1;
  if (IsSliver(RealPart(x1), RealPart(y1), RealPart(x2), RealPart(y2), RealPart(area))) {
    return FlatPlane(c);
  }
  FacePlane<T> plane{c.x[k0], c.y[k0], {T(0), T(0), T(0)}, {}, {}};
  plane.base[k0] = T(1);
  const T inverse = T(1) / area;
  plane.gx[k1] = y2 * inverse;
  plane.gy[k1] = -x2 * inverse;
  plane.gx[k2] = -y1 * inverse;
  plane.gy[k2] = x1 * inverse;
  plane.gx[k0] = -(plane.gx[k1] + plane.gx[k2]);
  plane.gy[k0] = -(plane.gy[k1] + plane.gy[k2]);
  return plane;
}

// What interpolation takes: flat if the face is thin or its edges reach too far (rule 8).
template <class T>
FacePlane<T> MakeFacePlane(const ScreenCorners<T>& c) {
  constexpr double kMost = kFlatLength * kFlatLength;
  const auto edge = [](const T& a, const T& b) { return RealPart(b) - RealPart(a); };
  const auto longest = LongestSquared(edge(c.x[0], c.x[1]), edge(c.y[0], c.y[1]),
                                      edge(c.x[0], c.x[2]), edge(c.y[0], c.y[2]));
  return longest < kMost ? MakeFacePlane(c, FarCorner(c)) : FlatPlane(c);
}

template <class T>
FacePlane<T> MakeFacePlane(const ScreenMeshT<T>& mesh, std::size_t face) {
  return MakeFacePlane(CornersOf(mesh, face));
}

// Lower bound of Q, the sum of m_k b_k (equation 1): the least m_k, or what Q changes by within
// 1/2048 pixel, by which coverage lets a pixel centre lie outside of its face. There the Q of a
// steep face can be anything; with the bound, the negative m_k b_k sum to no more than Q, and no
// attribute exceeds three times the largest of the corners. Of faces that are not steep, rule 8
// keeps the change below the least m_k.
template <class T>
T LeastQ(const FacePlane<T>& plane, const T (&m)[3]) {
  const auto less = [](const T& a, const T& b) { return RealPart(a) < RealPart(b); };
  const auto size = [&](const T& a) { return less(a, T(0)) ? -a : a; };
  T change = T(0);
  for (int k = 0; k < 3; ++k) change += m[k] * (size(plane.gx[k]) + size(plane.gy[k]));
  return std::max(std::min({m[0], m[1], m[2]}, less), change * T(kSnapError), less);
}

// 1/depth over a face; linear on the screen, clamped to the range of the corners, which rounding of
// a sliver could leave.
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
void SwapUnlessOrdered(ScreenCorners<T>* c, int i, int j) {
  const auto before = [](const T& p, const T& q) { return RealPart(p) < RealPart(q); };
  const bool same_x = !before(c->x[i], c->x[j]) && !before(c->x[j], c->x[i]);
  if (same_x ? !before(c->y[j], c->y[i]) : before(c->x[i], c->x[j])) return;
  std::swap(c->x[i], c->x[j]);
  std::swap(c->y[i], c->y[j]);
  std::swap(c->z[i], c->z[j]);
}

// Corners in an order independent of a face's first corner and winding: coinciding faces (both
// sides of a double-sided face) then have the same bits, so that the tie rule decides between them
// and not rounding.
template <class T>
ScreenCorners<T> OrderedCorners(const ScreenMeshT<T>& mesh, std::size_t face) {
  ScreenCorners<T> c = CornersOf(mesh, face);
  SwapUnlessOrdered(&c, 0, 1);
  SwapUnlessOrdered(&c, 1, 2);
  SwapUnlessOrdered(&c, 0, 1);
  return c;
}

template <class T>
DepthPlane<T> NarrowDepthPlane(const ScreenCorners<T>& c, int start) {
  const FacePlane<T> weights = MakeFacePlane(c, start);
  DepthPlane<T> plane{weights.x0, weights.y0, T(0), T(0), T(0), c.z[0], c.z[0]};
  for (int k = 0; k < 3; ++k) {
    plane.base += weights.base[k] * c.z[k];
    plane.gx += weights.gx[k] * c.z[k];
    plane.gy += weights.gy[k] * c.z[k];
    if (RealPart(c.z[k]) < RealPart(plane.low)) plane.low = c.z[k];
    if (RealPart(c.z[k]) > RealPart(plane.high)) plane.high = c.z[k];
  }
  return plane;
}

// Set up in double, relative to the centre of the visible part of the face's box. A clipped face
// reaches far out of the image, where its 1/depth is hundreds of times that in the image: relative
// to a corner out there, float would leave few digits.
inline DepthPlane<float> WideDepthPlane(const ScreenMesh& mesh, std::size_t face) {
  const ScreenCorners<float> c = OrderedCorners(mesh, face);
  const ScreenCorners<double> wide = Wide(c);
  const DepthPlane<double> plane = NarrowDepthPlane(wide, FarCorner(wide));
  const auto middle = [](const float(&v)[3], int size) {
    const auto [low, high] = std::minmax({v[0], v[1], v[2]});
    const auto end = static_cast<float>(size);
    return (std::clamp(low, 0.0f, end) + std::clamp(high, 0.0f, end)) / 2;
  };
  const float x0 = middle(c.x, mesh.width), y0 = middle(c.y, mesh.height);
  const double base = plane.base + (plane.gx * (x0 - plane.x0) + plane.gy * (y0 - plane.y0));
  constexpr double kMost = std::numeric_limits<float>::max();
  for (const double v : {base, plane.gx, plane.gy}) {
    if (!(std::abs(v) <= kMost)) return NarrowDepthPlane(c, 0);
  }
  return {x0,
          y0,
          static_cast<float>(base),
          static_cast<float>(plane.gx),
          static_cast<float>(plane.gy),
          static_cast<float>(plane.low),
          static_cast<float>(plane.high)};
}

template <class T>
DepthPlane<T> MakeDepthPlane(const ScreenMeshT<T>& mesh, std::size_t face) {
  if constexpr (std::is_same_v<T, float>) {
    return SnapFace(mesh, face).small() ? NarrowDepthPlane(OrderedCorners(mesh, face), 0)
                                        : WideDepthPlane(mesh, face);
  } else {
    const ScreenCorners<T> c = OrderedCorners(mesh, face);
    return NarrowDepthPlane(c, FarCorner(c));
  }
}

}  // namespace tilegrad::raster
