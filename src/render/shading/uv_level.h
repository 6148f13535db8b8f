// SPDX-License-Identifier: Apache-2.0
// The pyramid level of a texture for a pixel: log2 of the texels that one step on the screen
// crosses, the longer of the steps to the right and down (L. Williams, Pyramidal parametrics,
// 1983).
//
// With u = N / Q over a face (raster/interpolate.h), du/dx = (dN/dx - u dQ/dx) / Q. Planes are in
// double for any T: of a face that was cut at the near plane the image holds a far end, where that
// difference is a small remainder of what N and Q are elsewhere.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "raster/attributes.h"
#include "raster/face_plane.h"
#include "raster/screen_mesh.h"

namespace tilegrad {

// Derivatives of (u, v) over a face, as planes: N of each, and Q.
struct UvPlanes {
  double n_x[2] = {}, n_y[2] = {};
  double q_x = 0, q_y = 0, q = 0;  // q: at (x0, y0)
  double x0 = 0, y0 = 0, least_q = 0;
};

// How what is v0, v1, v2 at the corners of a face changes over the screen.
inline void SetSlopes(const raster::FacePlane<double>& face, double v0, double v1, double v2,
                      double* x, double* y) {
  *x = face.gx[1] * (v1 - v0) + face.gx[2] * (v2 - v0);
  *y = face.gy[1] * (v1 - v0) + face.gy[2] * (v2 - v0);
}

// Channels [first, first + 2) of the attributes are u, v.
template <class T>
UvPlanes UvPlanesOf(const raster::ScreenMeshT<T>& mesh,
                    const raster::AttributeViewT<const T>& attributes, int first, std::size_t face,
                    Interpolation mode) {
  const raster::ScreenCorners<double> corners = raster::Wide(raster::CornersOf(mesh, face));
  const raster::FacePlane<double> plane = raster::MakeFacePlane(corners);
  const bool perspective = mode == Interpolation::kPerspective;
  double m[3], n[2][3];
  for (int k = 0; k < 3; ++k) {
    m[k] = perspective ? corners.z[k] : 1.0;
    const T* const uv = attributes.corner(mesh, face, k) + first;
    for (int i = 0; i < 2; ++i) n[i][k] = m[k] * RealPart(uv[i]);
  }
  UvPlanes out;
  for (int i = 0; i < 2; ++i) {
    SetSlopes(plane, n[i][0], n[i][1], n[i][2], &out.n_x[i], &out.n_y[i]);
  }
  SetSlopes(plane, m[0], m[1], m[2], &out.q_x, &out.q_y);
  out.x0 = plane.x0;
  out.y0 = plane.y0;
  out.q = plane.base[0] * m[0] + plane.base[1] * m[1] + plane.base[2] * m[2];
  out.least_q = std::min({m[0], m[1], m[2]});
  return out;
}

// At the pixel centre (px, py), where the coordinates are (u, v), of a texture's size. Real: float,
// whose logarithm is quicker, or double.
template <class Real>
Real UvLevel(const UvPlanes& p, double px, double py, const double (&uv)[2], const int (&size)[2]) {
  const double q = std::max(p.q + p.q_x * (px - p.x0) + p.q_y * (py - p.y0), p.least_q);
  double across = 0, down = 0;
  for (int i = 0; i < 2; ++i) {
    const double texels = size[i] / q;
    const double x = (p.n_x[i] - uv[i] * p.q_x) * texels;
    const double y = (p.n_y[i] - uv[i] * p.q_y) * texels;
    across += x * x;
    down += y * y;
  }
  const double most = std::clamp(std::max(across, down), 1e-30, 1e30);
  return Real(0.5) * std::log2(static_cast<Real>(most));
}

}  // namespace tilegrad
