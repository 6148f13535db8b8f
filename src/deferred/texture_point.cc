// SPDX-License-Identifier: Apache-2.0
#include "deferred/texture_point.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "deferred/texture_cube.h"

namespace tilegrad::deferred {
namespace {

TexturePoint PlainPoint(const TextureCoordinates& at) {
  TexturePoint out{true, 0, {at.uv[0], at.uv[1]}, {}};
  out.valid = std::isfinite(at.uv[0]) && std::isfinite(at.uv[1]);
  std::copy(at.uv_da, at.uv_da + 4, out.slopes);
  return out;
}

// p = component / major of one axis of a face, and d(p)/d(X, Y) / 2, which is that of s or t.
struct CubeRatio {
  double p, major;
  double slopes[2];
};
CubeRatio RatioOf(const TextureCoordinates& at, const CubeAxis& axis, const CubeAxis& major) {
  CubeRatio out;
  out.major = Along(major, at.uv), out.p = Along(axis, at.uv) / out.major;
  for (int i = 0; i < 2; ++i) {
    const double d_axis = axis.sign * at.uv_da[2 * axis.index + i];
    const double d_major = major.sign * at.uv_da[2 * major.index + i];
    out.slopes[i] = (d_axis - out.p * d_major) / (2 * out.major);
  }
  return out;
}

TexturePoint CubePoint(const TextureCoordinates& at) {
  TexturePoint out{};
  out.face = CubeFaceOf({at.uv[0], at.uv[1], at.uv[2]});
  out.valid = out.face >= 0;
  if (!out.valid) return out;
  const CubeFace& face = kCubeFaces[out.face];
  const CubeAxis axes[2] = {face.s, face.t};
  for (int k = 0; k < 2; ++k) {
    const CubeRatio ratio = RatioOf(at, axes[k], face.major);
    out.st[k] = 0.5 * (ratio.p + 1);
    for (int i = 0; i < 2; ++i) out.slopes[2 * k + i] = ratio.slopes[i];
  }
  return out;
}

void CubeAdjoint(const TextureCoordinates& at, int face, const PointCotangent& d,
                 TextureCoordinates* out) {
  const CubeAxis& major = kCubeFaces[face].major;
  const CubeAxis axes[2] = {kCubeFaces[face].s, kCubeFaces[face].t};
  for (int k = 0; k < 2; ++k) {
    const CubeRatio ratio = RatioOf(at, axes[k], major);
    double d_p = 0.5 * d.d_st[k], d_major = 0;
    for (int i = 0; i < 2; ++i) {
      const double g = d.d_slopes[2 * k + i] / (2 * ratio.major);
      out->uv_da[2 * axes[k].index + i] += axes[k].sign * g;
      out->uv_da[2 * major.index + i] -= major.sign * g * ratio.p;
      d_p -= g * major.sign * at.uv_da[2 * major.index + i];
      d_major -= 2 * g * ratio.slopes[i];
    }
    out->uv[axes[k].index] += axes[k].sign * d_p / ratio.major;
    out->uv[major.index] += major.sign * (d_major - d_p * ratio.p / ratio.major);
  }
}

}  // namespace

TexturePoint PointOf(const TextureCoordinates& at, bool cube) {
  return cube ? CubePoint(at) : PlainPoint(at);
}

void PointAdjoint(const TextureCoordinates& at, const TexturePoint& point, bool cube,
                  const PointCotangent& d, TextureCoordinates* out) {
  *out = {};
  if (cube) return CubeAdjoint(at, point.face, d, out);
  std::copy(d.d_st, d.d_st + 2, out->uv);
  std::copy(d.d_slopes, d.d_slopes + 4, out->uv_da);
}

// The squared length is the larger eigenvalue of J^T J = (a c; c b).
FootprintLevel LevelOf(const double (&slopes)[4], const MipSize& size) {
  const double scale[4] = {static_cast<double>(size.width), static_cast<double>(size.width),
                           static_cast<double>(size.height), static_cast<double>(size.height)};
  double j[4];
  for (int i = 0; i < 4; ++i) j[i] = slopes[i] * scale[i];
  const double a = j[0] * j[0] + j[2] * j[2], b = j[1] * j[1] + j[3] * j[3];
  const double c = j[0] * j[1] + j[2] * j[3], half = 0.5 * (a - b);
  const double root = std::hypot(half, c), square = 0.5 * (a + b) + root;
  FootprintLevel out{-std::numeric_limits<double>::infinity(), {}};
  if (!(square > 0) || !std::isfinite(square)) return out;
  out.level = 0.5 * std::log2(square);
  // Of a round footprint both axes are the longer one; the derivative taken is that of their mean.
  const double cosine = root > 0 ? half / root : 0, sine = root > 0 ? c / root : 0;
  const double d_square = 0.5 / (square * std::log(2.0));
  const double d_a = 0.5 * (1 + cosine) * d_square, d_b = 0.5 * (1 - cosine) * d_square;
  const double d_c = sine * d_square;
  const double d_j[4] = {2 * j[0] * d_a + j[1] * d_c, 2 * j[1] * d_b + j[0] * d_c,
                         2 * j[2] * d_a + j[3] * d_c, 2 * j[3] * d_b + j[2] * d_c};
  for (int i = 0; i < 4; ++i) out.d_slopes[i] = d_j[i] * scale[i];
  return out;
}

}  // namespace tilegrad::deferred
