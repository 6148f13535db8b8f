// SPDX-License-Identifier: Apache-2.0
// Where an edge crosses the way from one pixel's centre to the next one's, and the adjoint.
// S: double, std::complex<double>.
//
// In homogeneous pixel coordinates relative to the first centre, with q along the way, r across it:
// the edge from i to j meets r = 0 at
//
//     t = q / w = (q_i r_j - q_j r_i) / (w_i r_j - w_j r_i)
#pragma once

#include <cmath>

#include "base/scalar.h"
#include "compat/nvdiffrast/pixel_grid.h"

namespace tilegrad::compat::nvdiffrast {

// The way: from the centre of a pixel, one pixel along axis 0 (x) or 1 (y), forwards or back.
struct PixelStep {
  PixelCentre from;
  int axis;
  int direction;    // 1 or -1
  double scale[2];  // pixels per unit of normalised device coordinates, along x and y
};

// A vertex seen from the way.
template <class S>
struct WayPoint {
  S q, r, w;
};

template <class S>
WayPoint<S> PointOnWay(const PixelStep& step, const S* p) {
  const S from_centre[2] = {(p[0] - step.from.x * p[3]) * step.scale[0],
                            (p[1] - step.from.y * p[3]) * step.scale[1]};
  return {from_centre[step.axis] * static_cast<double>(step.direction), from_centre[1 - step.axis],
          p[3]};
}

// Whether the edge crosses the way before its end, in front of the eye, at an angle that makes it
// this axis's affair (exactly 45 degrees belong to x).
template <class S>
bool CrossesWay(const PixelStep& step, const WayPoint<S>& i, const WayPoint<S>& j, S* t) {
  if ((RealPart(i.r) < 0) == (RealPart(j.r) < 0)) return false;
  const S m = i.w * j.r - j.w * i.r, n = i.q * j.r - j.q * i.r;
  if (!(RealPart(m) * (RealPart(j.r) - RealPart(i.r)) > 0)) return false;
  const double along = std::abs(RealPart(m));  // the edge's normal, scaled
  const double across = std::abs(RealPart(i.w) * RealPart(j.q) - RealPart(i.q) * RealPart(j.w));
  if (step.axis == 0 ? along < across : along <= across) return false;
  *t = n / m;
  return RealPart(*t) >= 0 && RealPart(*t) <= 1;
}

// d_p[4] += what d_way pulls.
template <class S>
void PointOnWayAdjoint(const PixelStep& step, const WayPoint<S>& d_way, S* d_p) {
  S d_from[2];
  d_from[step.axis] = d_way.q * static_cast<double>(step.direction) * step.scale[step.axis];
  d_from[1 - step.axis] = d_way.r * step.scale[1 - step.axis];
  d_p[0] += d_from[0];
  d_p[1] += d_from[1];
  d_p[3] += d_way.w - step.from.x * d_from[0] - step.from.y * d_from[1];
}

// d_i[4], d_j[4] += what d_t pulls on the ends of an edge that crosses at t.
template <class S>
void CrossingAdjoint(const PixelStep& step, const WayPoint<S>& i, const WayPoint<S>& j, S t, S d_t,
                     S* d_i, S* d_j) {
  const S d_n = d_t / (i.w * j.r - j.w * i.r), d_m = -t * d_n;
  PointOnWayAdjoint(step, {d_n * j.r, -(d_n * j.q + d_m * j.w), d_m * j.r}, d_i);
  PointOnWayAdjoint(step, {-(d_n * i.r), d_n * i.q + d_m * i.w, -(d_m * i.r)}, d_j);
}

}  // namespace tilegrad::compat::nvdiffrast
