// SPDX-License-Identifier: Apache-2.0
// Cube maps: from a direction to a point on a face and back, and neighbours across edges.
//
// Point (s, t) of a face, in [0, 1]^2: s = (p + 1) / 2, t = (q + 1) / 2, p and q the components of
// the direction along the face's axes, divided by the largest component (OpenGL 4.6, table 8.19).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace tilegrad::compat::nvdiffrast {

// Signed axes of a face: component `index` times `sign`.
struct CubeAxis {
  int index;
  double sign;
};
struct CubeFace {
  CubeAxis s, t, major;
};
inline constexpr CubeFace kCubeFaces[6] = {
    {{2, -1}, {1, -1}, {0, 1}}, {{2, 1}, {1, -1}, {0, -1}}, {{0, 1}, {2, 1}, {1, 1}},
    {{0, 1}, {2, -1}, {1, -1}}, {{0, 1}, {1, -1}, {2, 1}},  {{0, -1}, {1, -1}, {2, -1}},
};

using Direction = std::array<double, 3>;

// The face that a direction hits, -1 for none: the zero vector, or one that is not finite.
inline int CubeFaceOf(const Direction& r) {
  int axis = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(r[i]) > std::abs(r[axis])) axis = i;
  }
  const double largest = std::abs(r[axis]);
  const double sum = r[0] + r[1] + r[2];
  if (!(largest > 0) || !std::isfinite(sum)) return -1;
  return 2 * axis + (r[axis] < 0 ? 1 : 0);
}

inline double Along(const CubeAxis& axis, const double* r) { return axis.sign * r[axis.index]; }

// A texel of a cube map of `size` texels a side, at most one step outside of face `face`.
struct CubeTexel {
  int face, x, y;
};

// The texel at this position: on the face, or across its edge; not at a corner.
inline CubeTexel AcrossEdge(const CubeTexel& texel, int size) {
  if (texel.x >= 0 && texel.x < size && texel.y >= 0 && texel.y < size) return texel;
  const CubeFace& from = kCubeFaces[texel.face];
  const auto centre = [&](int i) { return (2.0 * i + 1.0) / size - 1.0; };
  Direction r{};
  r[static_cast<std::size_t>(from.major.index)] = from.major.sign;
  r[static_cast<std::size_t>(from.s.index)] = from.s.sign * centre(texel.x);
  r[static_cast<std::size_t>(from.t.index)] = from.t.sign * centre(texel.y);
  const int face = CubeFaceOf(r);
  const CubeFace& to = kCubeFaces[face];
  // This moves it along the edge by less than half a texel towards the middle, so the texel stays
  // the same.
  const auto cell = [&](const CubeAxis& axis) {
    const double p = Along(axis, r.data()) / Along(to.major, r.data());
    const int i = static_cast<int>(std::floor((p + 1) * 0.5 * size));
    return i < 0 ? 0 : i < size ? i : size - 1;
  };
  return {face, cell(to.s), cell(to.t)};
}

}  // namespace tilegrad::compat::nvdiffrast
