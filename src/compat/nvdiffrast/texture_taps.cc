// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/texture_taps.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "compat/nvdiffrast/texture_cube.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

void FindPlainPoint(const TextureCoordinates& at, TexturePoint* out) {
  out->valid = std::isfinite(at.uv[0]) && std::isfinite(at.uv[1]);
  out->face = 0;
  for (int i = 0; i < 2; ++i) out->st[i] = at.uv[i];
  for (int i = 0; i < 4; ++i) out->slopes[i] = at.uv_da[i];
}

// p = component / major of one axis of a face, and d(p)/d(X, Y) / 2, which is that of s or t.
struct CubeRatio {
  double p, major;
  double slopes[2];
};
CubeRatio RatioOf(const TextureCoordinates& at, const CubeAxis& axis, const CubeAxis& major) {
  CubeRatio out;
  out.major = Along(major, at.uv);
  out.p = Along(axis, at.uv) / out.major;
  for (int i = 0; i < 2; ++i) {
    const double d_axis = axis.sign * at.uv_da[2 * axis.index + i];
    const double d_major = major.sign * at.uv_da[2 * major.index + i];
    out.slopes[i] = (d_axis - out.p * d_major) / (2 * out.major);
  }
  return out;
}

void FindCubePoint(const TextureCoordinates& at, TexturePoint* out) {
  out->face = CubeFaceOf({at.uv[0], at.uv[1], at.uv[2]});
  out->valid = out->face >= 0;
  if (!out->valid) return;
  const CubeFace& face = kCubeFaces[out->face];
  const CubeAxis axes[2] = {face.s, face.t};
  for (int k = 0; k < 2; ++k) {
    const CubeRatio ratio = RatioOf(at, axes[k], face.major);
    out->st[k] = 0.5 * (ratio.p + 1);
    for (int i = 0; i < 2; ++i) out->slopes[2 * k + i] = ratio.slopes[i];
  }
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

// J = d(s W, t H)/d(X, Y). The squared length of its longer axis is the larger eigenvalue of
// J^T J = (a c; c b).
struct Footprint {
  double scale[2], j[4];
  double half, c, root, square;  // (a - b) / 2, c, hypot(half, c)

  Footprint(const double (&slopes)[4], const MipSize& size)
      : scale{static_cast<double>(size.width), static_cast<double>(size.height)} {
    for (int i = 0; i < 4; ++i) j[i] = slopes[i] * scale[i / 2];
    const double a = j[0] * j[0] + j[2] * j[2], b = j[1] * j[1] + j[3] * j[3];
    half = 0.5 * (a - b);
    c = j[0] * j[1] + j[2] * j[3];
    root = std::sqrt(half * half + c * c);
    square = 0.5 * (a + b) + root;
  }
};

// One axis: texels `low` and `high`, the weight of `high`, and its derivative by the coordinate. In
// a cube map texels may be -1 or n, on the adjacent face; kOutside gives zeros.
constexpr int kOutside = -2;
struct AxisTaps {
  int low, high;
  double weight, slope;
};

// Faster than std::floor where the instruction is missing.
double Floor(double x) {
  if (!(std::abs(x) < 0x1p31)) return std::floor(x);
  const double whole = static_cast<double>(static_cast<std::int32_t>(x));
  return whole > x ? whole - 1 : whole;
}

AxisTaps NearestTap(double s, int n, TextureBoundary boundary) {
  const double x = Floor((boundary == TextureBoundary::kWrap ? s - Floor(s) : s) * n);
  if (boundary == TextureBoundary::kZero && !(x >= 0 && x < n)) return {kOutside, kOutside, 0, 0};
  const int i = static_cast<int>(std::clamp(x, 0.0, n - 1.0));
  return {i, i, 0, 0};
}

AxisTaps Between(double x, int n) {
  const int low = static_cast<int>(Floor(x));
  return {low, low + 1, x - low, static_cast<double>(n)};
}

AxisTaps WrapTaps(double s, int n) {
  AxisTaps out = Between((s - Floor(s)) * n - 0.5, n);
  if (out.low < 0) out.low = n - 1;
  if (out.high >= n) out.high = 0;
  return out;
}

AxisTaps ClampTaps(double s, int n) {
  const double x = s * n - 0.5;
  if (x <= 0) return {0, 0, 0, 0};
  if (x >= n - 1) return {n - 1, n - 1, 0, 0};
  return Between(x, n);
}

AxisTaps ZeroTaps(double s, int n) {
  const double x = s * n - 0.5;
  if (!(x > -1 && x < n)) return {kOutside, kOutside, 0, 0};
  AxisTaps out = Between(x, n);
  if (out.low < 0) out.low = kOutside;
  if (out.high >= n) out.high = kOutside;
  return out;
}

AxisTaps LinearTaps(double s, int n, TextureBoundary boundary) {
  switch (boundary) {
    case TextureBoundary::kWrap:
      return WrapTaps(s, n);
    case TextureBoundary::kClamp:
      return ClampTaps(s, n);
    case TextureBoundary::kZero:
      return ZeroTaps(s, n);
    case TextureBoundary::kCube:
      break;
  }
  return Between(std::clamp(s * n - 0.5, -0.5, n - 0.5), n);
}

}  // namespace

void FindPoint(const TextureCoordinates& at, bool cube, TexturePoint* out) {
  return cube ? FindCubePoint(at, out) : FindPlainPoint(at, out);
}

void PointAdjoint(const TextureCoordinates& at, const TexturePoint& point, bool cube,
                  const PointCotangent& d, TextureCoordinates* out) {
  *out = {};
  if (cube) return CubeAdjoint(at, point.face, d, out);
  std::copy(d.d_st, d.d_st + 2, out->uv);
  std::copy(d.d_slopes, d.d_slopes + 4, out->uv_da);
}

double LevelOf(const double (&slopes)[4], const MipSize& size) {
  const Footprint f(slopes, size);
  return f.square > 0 ? 0.5 * std::log2(f.square) : -std::numeric_limits<double>::infinity();
}

void LevelAdjoint(const double (&slopes)[4], const MipSize& size, double d_level,
                  double (&d_slopes)[4]) {
  const Footprint f(slopes, size);
  // For a round footprint both axes are the longer one; takes the derivative of their mean.
  const double cosine = f.root > 0 ? f.half / f.root : 0, sine = f.root > 0 ? f.c / f.root : 0;
  const double d_square = 0.5 * d_level / (f.square * std::numbers::ln2);
  const double d_a = 0.5 * (1 + cosine) * d_square, d_b = 0.5 * (1 - cosine) * d_square;
  const double d_c = sine * d_square;
  for (int i = 0; i < 4; i += 2) {
    d_slopes[i] = (2 * f.j[i] * d_a + f.j[i + 1] * d_c) * f.scale[i / 2];
    d_slopes[i + 1] = (2 * f.j[i + 1] * d_b + f.j[i] * d_c) * f.scale[i / 2];
  }
}

std::ptrdiff_t TexelAt(int x, int y, int face, const MipSize& size, TextureBoundary boundary) {
  if (x == kOutside || y == kOutside) return Taps::kNothing;
  CubeTexel texel{face, x, y};
  if (boundary == TextureBoundary::kCube) {
    const bool past_x = x < 0 || x >= size.width, past_y = y < 0 || y >= size.height;
    if (past_x && past_y) return Taps::kMean;
    texel = AcrossEdge(texel, size.width);
  }
  return (static_cast<std::ptrdiff_t>(texel.face) * size.height + texel.y) * size.width + texel.x;
}

void FindTaps(const TexturePoint& point, const MipSize& size, bool nearest,
              TextureBoundary boundary, Taps* out) {
  const AxisTaps x = nearest ? NearestTap(point.st[0], size.width, boundary)
                             : LinearTaps(point.st[0], size.width, boundary);
  const AxisTaps y = nearest ? NearestTap(point.st[1], size.height, boundary)
                             : LinearTaps(point.st[1], size.height, boundary);
  out->count = nearest ? 1 : 4;
  out->a = x.weight;
  out->b = y.weight;
  out->slope_a = x.slope;
  out->slope_b = y.slope;
  for (int k = 0; k < out->count; ++k) {
    out->texel[k] = TexelAt(k % 2 == 0 ? x.low : x.high, k / 2 == 0 ? y.low : y.high, point.face,
                            size, boundary);
  }
}

}  // namespace tilegrad::compat::nvdiffrast
