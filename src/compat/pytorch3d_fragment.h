// SPDX-License-Identifier: Apache-2.0
// One face at one pixel, which PyTorch3D calls a fragment, and its adjoint: barycentrics, depth,
// and the signed squared distance to the face's boundary, as in PyTorch3D's rasterizer. Coordinates
// are its NDC, x left, y up, with z the camera depth, > 0 in front.
//
//     A_k = -W_k (projected_batch.h), A = sum A_k     positive for front faces
//     b_k = A_k / (A + eps)                           linear on the screen
//     w_k = b_k z_l z_m / max(sum_j ..., eps)         if perspective_correct
//     c_k = max(w_k, 0) / max(sum_j max(w_j, 0), 1e-5)         if clip_barycentrics
//     z = sum c_k z_k
//     dist = the least squared distance to an edge, negative inside (all w_k > 0)
//
// Scalar template: float, double, std::complex<double>.
#pragma once

#include <array>
#include <cstddef>

#include "base/scalar.h"
#include "compat/projected_batch.h"

namespace tilegrad::compat::pytorch3d {

inline constexpr double kFragmentEps = 1e-8;  // for areas, depths, squared lengths; as in PyTorch3D
inline constexpr double kLeastClippedSum = 1e-5;

struct FragmentRule {
  bool perspective_correct = true;
  bool clip_barycentrics = false;
};

template <class T>
struct LayeredFragment {
  std::array<T, 3> bary;  // c
  T z, dist;
  bool inside;
};

// Intermediate values between the corners and the barycentrics.
template <class T>
struct FragmentWeights {
  std::array<T, 3> b, w, c;
  T area, sum, clipped_sum;  // A + eps, and the two denominators before they are clamped
};

template <class T>
T AtLeast(const T& value, double least) {
  return RealPart(value) < RealPart(T(least)) ? T(least) : value;
}

// Corners [3,3]: x, y, z.
template <class T>
FragmentWeights<T> WeightsOf(const T* v, const T& px, const T& py, const FragmentRule& rule) {
  const T xy[6] = {v[0], v[1], v[3], v[4], v[6], v[7]};
  FragmentWeights<T> out;
  out.b = CornerAreas(xy, px, py);
  out.area = T(kFragmentEps) - ((out.b[0] + out.b[1]) + out.b[2]);
  for (T& b : out.b) b = -b / out.area;
  out.w = out.b;
  out.sum = T(1);
  if (rule.perspective_correct) {
    for (std::size_t k = 0; k < 3; ++k) {
      out.w[k] = out.b[k] * v[3 * ((k + 1) % 3) + 2] * v[3 * ((k + 2) % 3) + 2];
    }
    out.sum = out.w[0] + out.w[1] + out.w[2];
    for (T& w : out.w) w /= AtLeast(out.sum, kFragmentEps);
  }
  out.c = out.w;
  out.clipped_sum = T(1);
  if (rule.clip_barycentrics) {
    for (T& c : out.c) c = AtLeast(c, 0);
    out.clipped_sum = out.c[0] + out.c[1] + out.c[2];
    for (T& c : out.c) c /= AtLeast(out.clipped_sum, kLeastClippedSum);
  }
  return out;
}

// The nearest point of the boundary is corner `from` plus t times the way to the next corner;
// (rx, ry) leads from there to the pixel.
template <class T>
struct BoundaryPoint {
  std::size_t from;
  T t, rx, ry, squared;
};

template <class T>
BoundaryPoint<T> NearestOnEdge(const T* v, std::size_t k, const T& px, const T& py) {
  const T* a = v + 3 * k;
  const T* b = v + 3 * ((k + 1) % 3);
  const T ex = b[0] - a[0], ey = b[1] - a[1];
  const T length = ex * ex + ey * ey;
  T t = T(1);
  if (RealPart(length) > kFragmentEps) t = ((px - a[0]) * ex + (py - a[1]) * ey) / length;
  if (RealPart(t) < 0) t = T(0);
  if (RealPart(t) > 1) t = T(1);
  const T rx = px - a[0] - t * ex, ry = py - a[1] - t * ey;
  return {k, t, rx, ry, rx * rx + ry * ry};
}

template <class T>
BoundaryPoint<T> NearestOnBoundary(const T* v, const T& px, const T& py) {
  BoundaryPoint<T> best = NearestOnEdge(v, 0, px, py);
  for (std::size_t k = 1; k < 3; ++k) {
    const BoundaryPoint<T> other = NearestOnEdge(v, k, px, py);
    if (RealPart(other.squared) < RealPart(best.squared)) best = other;
  }
  return best;
}

template <class T>
bool IsInside(const FragmentWeights<T>& at) {
  return RealPart(at.w[0]) > 0 && RealPart(at.w[1]) > 0 && RealPart(at.w[2]) > 0;
}

template <class T>
LayeredFragment<T> FragmentOf(const T* v, const T& px, const T& py, const FragmentRule& rule) {
  const FragmentWeights<T> at = WeightsOf(v, px, py, rule);
  const bool inside = IsInside(at);
  const T squared = NearestOnBoundary(v, px, py).squared;
  return {at.c, at.c[0] * v[2] + at.c[1] * v[5] + at.c[2] * v[8], inside ? -squared : squared,
          inside};
}

// The adjoint of x_k / max(sum x, least), y_k given.
template <class T>
std::array<T, 3> NormalizeBackward(const std::array<T, 3>& y, const T& sum, double least,
                                   const std::array<T, 3>& d_y) {
  const T along = d_y[0] * y[0] + d_y[1] * y[1] + d_y[2] * y[2];
  const bool kept_up = RealPart(sum) < RealPart(T(least));
  const T denominator = AtLeast(sum, least);
  std::array<T, 3> d_x;
  for (std::size_t k = 0; k < 3; ++k) {
    d_x[k] = (d_y[k] - (kept_up ? T(0) : along)) / denominator;
  }
  return d_x;
}

// From d_b to corners: b_k = A_k / (A + eps).
template <class T>
void BarycentricsBackward(const T* v, const T& px, const T& py, const FragmentWeights<T>& at,
                          const std::array<T, 3>& d_b, T* d_v) {
  const T along = d_b[0] * at.b[0] + d_b[1] * at.b[1] + d_b[2] * at.b[2];
  for (std::size_t k = 0; k < 3; ++k) {
    const T d_area = (d_b[k] - along) / at.area;  // of A_k
    const std::size_t l = 3 * ((k + 1) % 3), m = 3 * ((k + 2) % 3);
    d_v[l] -= d_area * (v[m + 1] - py);
    d_v[l + 1] += d_area * (v[m] - px);
    d_v[m] += d_area * (v[l + 1] - py);
    d_v[m + 1] -= d_area * (v[l] - px);
  }
}

// Adds the adjoint of one fragment to d_v [3,3]. Holds the nearest boundary point fixed.
template <class T>
void FragmentBackward(const T* v, const T& px, const T& py, const FragmentRule& rule,
                      const std::array<T, 3>& d_bary, const T& d_z, const T& d_dist, T* d_v) {
  const FragmentWeights<T> at = WeightsOf(v, px, py, rule);
  std::array<T, 3> d = d_bary;
  for (std::size_t k = 0; k < 3; ++k) {
    d[k] += d_z * v[3 * k + 2];
    d_v[3 * k + 2] += d_z * at.c[k];
  }
  if (rule.clip_barycentrics) {
    d = NormalizeBackward(at.c, at.clipped_sum, kLeastClippedSum, d);
    for (std::size_t k = 0; k < 3; ++k) {
      if (!(RealPart(at.w[k]) > 0)) d[k] = T(0);
    }
  }
  if (rule.perspective_correct) {
    d = NormalizeBackward(at.w, at.sum, kFragmentEps, d);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t l = 3 * ((k + 1) % 3) + 2, m = 3 * ((k + 2) % 3) + 2;
      d_v[l] += d[k] * at.b[k] * v[m];
      d_v[m] += d[k] * at.b[k] * v[l];
      d[k] *= v[l] * v[m];
    }
  }
  BarycentricsBackward(v, px, py, at, d, d_v);
  const BoundaryPoint<T> near = NearestOnBoundary(v, px, py);
  const T push = T(IsInside(at) ? 2 : -2) * d_dist;
  const std::size_t a = 3 * near.from, b = 3 * ((near.from + 1) % 3);
  d_v[a] += push * (T(1) - near.t) * near.rx;
  d_v[a + 1] += push * (T(1) - near.t) * near.ry;
  d_v[b] += push * near.t * near.rx;
  d_v[b + 1] += push * near.t * near.ry;
}

}  // namespace tilegrad::compat::pytorch3d
