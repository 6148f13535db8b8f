// SPDX-License-Identifier: Apache-2.0
// Records of the soft mask's kernel. Lengths are kernel units (soft_mask.h) and double where a
// small difference of large coordinates is taken; the vector code sees floats relative to the
// centre of a block of 8x8 pixels. docs/numerics.md: "The distance to a boundary".
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace tilegrad::raster {

inline constexpr int kBlockSize = 8;  // pixels; culling decides per block, vectors run inside
inline constexpr int kBlockPixels = kBlockSize * kBlockSize;
// Members whose products are taken in float before they are merged in double: bounds rounding
// independently of the number of faces.
inline constexpr std::size_t kMergeEvery = 16;

// A directed edge, as seen from an origin: unit direction t, normal n = (-t.y, t.x); the origin
// lies at `side` along n and at `along` along t from the first corner.
struct SoftEdge {
  double tx, ty, side, along, length;
  double inverse_length;  // 0 for an edge of no length
};

struct SoftFace {
  double left, top, right, bottom;  // box
  SoftEdge edge[3];                 // edge k: corner k to corner k + 1
  bool far;                         // from all pixels of the tile that are computed
};

// Squared distance of (x, y) to an edge, the point given relative to the edge's origin.
inline double SquaredDistance(const SoftEdge& e, double x, double y) {
  const double side = e.side - e.ty * x + e.tx * y;
  const double along = e.along + e.tx * x + e.ty * y;
  const double beyond = std::max(along - e.length, 0.0) + std::min(along, 0.0);
  return side * side + beyond * beyond;
}

// A SoftEdge for the vector code, seen from the centre of a block.
struct SoftBlockEdge {
  float tx, ty, side, along;
  float past;            // along - length, from double
  float inverse_length;  // 0 for an edge of no length, which belongs to its first corner
};
struct SoftBlockFace {
  SoftBlockEdge edge[3];
  std::int32_t position;  // in the tile's list
};

// One block for the vector code.
struct SoftBlock {
  alignas(32) float x[kBlockSize], y[kBlockSize];  // pixel centres from the block's centre
  const SoftBlockFace* members;
  std::size_t count;
  double stop;  // a remaining product up to here may be taken as 0
};

// Forward: alpha in double, 1 for pixels that need not be computed; stopped[r]: row pair r left
// out members behind.
struct SoftBlockAlpha {
  alignas(64) double alpha[kBlockPixels];
  bool stopped[kBlockSize / 2];
};

// Backward.
struct SoftBlockGradient {
  alignas(64) float d_alpha[kBlockPixels];  // 0 for pixels that have none
  float* products;                          // [count][kBlockPixels]
  float* d_corners;                         // [6][stride] d_x[3], d_y[3]; added to, per kernel unit
  std::size_t stride;                       // the length of the tile's list
};

}  // namespace tilegrad::raster
