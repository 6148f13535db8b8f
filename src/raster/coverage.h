// SPDX-License-Identifier: Apache-2.0
// Coverage in integers: the fill rule of conventions.h, without rounding error. Scalar; shared by
// the reference and the set-up of the vector kernel, so that both decide alike.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "base/scalar.h"
#include "raster/conventions.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

__extension__ using Int128 = __int128;  // a GCC and Clang extension

// To the nearest subpixel; ties to even.
template <class T>
std::int64_t Snap(const T& pixels) {
  const double p = std::clamp(static_cast<double>(RealPart(pixels)), -kMaxSnap, kMaxSnap);
  return std::llrint(p * static_cast<double>(kSubpixels));
}

// Faces up to this wide and high are small: relative to a pixel centre within the face's box,
// products in their exact edge functions fit into 32 bits.
inline constexpr std::int32_t kSmallExtent = 30 * 1024;  // subpixels
// Small faces are also no farther from the origin than this.
inline constexpr std::int32_t kFarSubpixels = 1 << 30;

// A face in subpixels.
struct SnappedFace {
  std::int64_t x[3], y[3];

  bool small() const {
    for (const auto* c : {x, y}) {
      const auto [low, high] = std::minmax({c[0], c[1], c[2]});
      if (low <= -kFarSubpixels || high >= kFarSubpixels || high - low > kSmallExtent) return false;
    }
    return true;
  }
  // All corners within the guard band: edge functions fit into 64 bits, and after division by
  // kSubpixels, stepped through a tile, into 32.
  bool guarded() const {
    constexpr auto kLimit = static_cast<std::int64_t>(kGuardBand) * kSubpixels;
    bool inside = true;
    for (int k = 0; k < 3; ++k) inside &= std::abs(x[k]) <= kLimit && std::abs(y[k]) <= kLimit;
    return inside;
  }
  // Twice the area, positive if clockwise as seen.
  template <class Int>
  Int DoubledArea() const {
    return Int(x[1] - x[0]) * Int(y[2] - y[0]) - Int(x[2] - x[0]) * Int(y[1] - y[0]);
  }
  int AreaSign() const {
    if (guarded()) {
      const auto area = DoubledArea<std::int64_t>();
      return (area > 0) - (area < 0);
    }
    const auto area = DoubledArea<Int128>();
    return (area > 0) - (area < 0);
  }
  // E of edge k (from corner k to corner k+1) at a point in subpixels, minus one if the edge is
  // neither left nor top: the point is on the inner side if and only if the result is >= 0, for a
  // face of positive area.
  template <class Int>
  Int EdgeAt(int k, std::int64_t px, std::int64_t py) const {
    const int n = k == 2 ? 0 : k + 1;
    const std::int64_t dx = x[n] - x[k], dy = y[n] - y[k];
    const bool left_or_top = dy < 0 || (dy == 0 && dx > 0);
    return Int(dx) * Int(py - y[k]) - Int(dy) * Int(px - x[k]) - Int(left_or_top ? 0 : 1);
  }
};

// `face` with its original winding.
template <class T>
SnappedFace SnapFace(const ScreenMeshT<T>& mesh, std::size_t face) {
  SnappedFace out;
  for (int k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(mesh.vertex(face, k));
    out.x[k] = Snap(mesh.x[v]);
    out.y[k] = Snap(mesh.y[v]);
  }
  return out;
}

// Rewound so that its area is not negative, as EdgeAt requires.
template <class T>
SnappedFace SnapFaceClockwise(const ScreenMeshT<T>& mesh, std::size_t face) {
  SnappedFace out = SnapFace(mesh, face);
  if (out.AreaSign() < 0) {
    std::swap(out.x[1], out.x[2]);
    std::swap(out.y[1], out.y[2]);
  }
  return out;
}

// The centre of pixel (column, row), in subpixels along one axis.
inline std::int64_t CentreSubpixel(int index) { return index * kSubpixels + kSubpixels / 2; }

template <class Int>
bool CoversAs(const SnappedFace& face, int column, int row) {
  const std::int64_t px = CentreSubpixel(column), py = CentreSubpixel(row);
  return face.EdgeAt<Int>(0, px, py) >= 0 && face.EdgeAt<Int>(1, px, py) >= 0 &&
         face.EdgeAt<Int>(2, px, py) >= 0;
}

// Whether a face of positive area covers the pixel.
inline bool Covers(const SnappedFace& face, int column, int row) {
  return face.guarded() ? CoversAs<std::int64_t>(face, column, row)
                        : CoversAs<Int128>(face, column, row);
}

// Bits of FaceReject determined by the shape on the screen.
inline std::uint8_t ShapeReject(const SnappedFace& face, bool cull_back) {
  const int sign = face.AreaSign();
  if (sign == 0) return kFaceDegenerate;
  return cull_back && sign > 0 ? kFaceCulled : kFaceDrawn;
}

}  // namespace tilegrad::raster
