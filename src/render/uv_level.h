// SPDX-License-Identifier: Apache-2.0
// Which level of a texture's pyramid a pixel wants: log2 of the texels that one step on the screen
// crosses, the longer of the steps to the right and down (L. Williams, Pyramidal parametrics,
// 1983).
//
// With u = N / Q over a face (raster/interpolate.h), du/dx = (dN/dx - u dQ/dx) / Q.
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

// Channels [first, first + 2) of the attributes are u, v.
template <class T>
UvPlanes UvPlanesOf(const raster::ScreenMeshT<T>& mesh,
                    const raster::AttributeViewT<const T>& attributes, int first, std::size_t face,
                    Interpolation mode) {
  const auto plane = raster::MakeFacePlane(mesh, face);
  UvPlanes out;
  out.x0 = raster::RealPart(plane.x0), out.y0 = raster::RealPart(plane.y0);
  for (int k = 0; k < 3; ++k) {
    const auto vertex = static_cast<std::size_t>(mesh.vertex(face, k));
    const bool perspective = mode == Interpolation::kPerspective;
    const double m = perspective ? raster::RealPart(mesh.inverse_depth[vertex]) : 1.0;
    const double gx = m * raster::RealPart(plane.gx[k]), gy = m * raster::RealPart(plane.gy[k]);
    const T* const uv = attributes.corner(mesh, face, k) + first;
    for (int i = 0; i < 2; ++i) {
      out.n_x[i] += gx * raster::RealPart(uv[i]), out.n_y[i] += gy * raster::RealPart(uv[i]);
    }
    out.q_x += gx, out.q_y += gy, out.q += m * raster::RealPart(plane.base[k]);
    out.least_q = k == 0 ? m : std::min(out.least_q, m);
  }
  return out;
}

// At the pixel centre (px, py), where the coordinates are (u, v), of a texture's size.
inline float UvLevel(const UvPlanes& p, double px, double py, const double (&uv)[2],
                     const int (&size)[2]) {
  const double q = std::max(p.q + p.q_x * (px - p.x0) + p.q_y * (py - p.y0), p.least_q);
  double across = 0, down = 0;
  for (int i = 0; i < 2; ++i) {
    const double x = (p.n_x[i] - uv[i] * p.q_x) / q * size[i];
    const double y = (p.n_y[i] - uv[i] * p.q_y) / q * size[i];
    across += x * x, down += y * y;
  }
  const double most = std::clamp(std::max(across, down), 1e-30, 1e30);
  return 0.5f * std::log2(static_cast<float>(most));
}

}  // namespace tilegrad
