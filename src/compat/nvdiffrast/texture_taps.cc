// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/texture_taps.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "compat/nvdiffrast/texture_cube.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

// One axis: texels `low` and `high`, the weight of `high`, and its derivative by the coordinate.
// Texels may be -1 or n of a cube map, which lie on the next face; kOutside holds zeros.
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
