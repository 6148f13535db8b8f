// SPDX-License-Identifier: Apache-2.0
// A texture lookup: the point, the mip level, and the texels read there.
#pragma once

#include <cstddef>

#include "compat/nvdiffrast/texture.h"

namespace tilegrad::compat::nvdiffrast {

// From the coordinates of a pixel to a point on a texture with its footprint, then to the mip
// level; and the adjoints. In double.

// (s, t) on a face (0 for a plain texture) and d(s, t)/d(X, Y): ds/dX, ds/dY, dt/dX, dt/dY.
struct TexturePoint {
  bool valid;
  int face;
  double st[2];
  double slopes[4];
};

// Coordinates of a pixel: s and t, or a direction; and their derivatives by X and Y, zero if
// unknown.
struct TextureCoordinates {
  double uv[3];
  double uv_da[6];
};

// Overwrites *out. (Not returned: a copy would wait for the stores.)
void FindPoint(const TextureCoordinates& at, bool cube, TexturePoint* out);

// Adjoint of FindPoint, from cotangents of st and slopes to those of the coordinates: overwrites
// *out.
struct PointCotangent {
  double d_st[2], d_slopes[4];
};
void PointAdjoint(const TextureCoordinates& at, const TexturePoint& point, bool cube,
                  const PointCotangent& d, TextureCoordinates* out);

// log2 of the length of the longer axis of a footprint, in texels; minus infinity if the footprint
// is a point or NaN.
double LevelOf(const double (&slopes)[4], const MipSize& size);
// d_slopes <- d_level times the derivative of the level, if that is finite.
void LevelAdjoint(const double (&slopes)[4], const MipSize& size, double d_level,
                  double (&d_slopes)[4]);

// The texels that a lookup reads in one level, and their weights.

// Four texels (one, if nearest) with weights (1-a)(1-b), a(1-b), (1-a)b and ab at texel[0..3].
struct Taps {
  static constexpr std::ptrdiff_t kNothing = -1;  // zeros
  static constexpr std::ptrdiff_t kMean = -2;     // the mean of the other three

  std::ptrdiff_t texel[4];  // index over all faces of one texture
  int count;
  double a, b;
  double slope_a, slope_b;  // da/ds, db/dt

  double weight(int k) const {
    if (count == 1) return 1;
    return (k % 2 == 0 ? 1 - a : a) * (k / 2 == 0 ? 1 - b : b);
  }
};

// The texel of a face in column x and row y, or its substitute beyond the face; for a cube map at
// most one step beyond.
std::ptrdiff_t TexelAt(int x, int y, int face, const MipSize& size, TextureBoundary boundary);

// Overwrites *out; `point` must be valid.
void FindTaps(const TexturePoint& point, const MipSize& size, bool nearest,
              TextureBoundary boundary, Taps* out);

}  // namespace tilegrad::compat::nvdiffrast
