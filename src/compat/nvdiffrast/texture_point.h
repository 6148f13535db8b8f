// SPDX-License-Identifier: Apache-2.0
// From the coordinates of a pixel to a point on a texture with its footprint, and from there to the
// level of the pyramid; and the adjoints. In double.
#pragma once

#include <cstddef>

#include "compat/nvdiffrast/mip.h"

namespace tilegrad::compat::nvdiffrast {

// (s, t) on a face (0 of a plain texture) and d(s, t)/d(X, Y): ds/dX, ds/dY, dt/dX, dt/dY.
struct TexturePoint {
  bool valid;
  int face;
  double st[2];
  double slopes[4];
};

// Coordinates of a pixel: s and t, or a direction; and their derivatives by X and Y, zero where not
// known.
struct TextureCoordinates {
  double uv[3];
  double uv_da[6];
};

// Overwrites *out. (Not returned: a copy would wait for what has just been written.)
void FindPoint(const TextureCoordinates& at, bool cube, TexturePoint* out);

// Cotangents of st and slopes, to those of the coordinates: overwrites *out.
struct PointCotangent {
  double d_st[2], d_slopes[4];
};
void PointAdjoint(const TextureCoordinates& at, const TexturePoint& point, bool cube,
                  const PointCotangent& d, TextureCoordinates* out);

// log2 of the length of the longer axis of a footprint, in texels: minus infinity where it is a
// point, or not a number.
double LevelOf(const double (&slopes)[4], const MipSize& size);
// d_slopes <- d_level times the derivative of a level that is finite.
void LevelAdjoint(const double (&slopes)[4], const MipSize& size, double d_level,
                  double (&d_slopes)[4]);

}  // namespace tilegrad::compat::nvdiffrast
