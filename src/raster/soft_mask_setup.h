// SPDX-License-Identifier: Apache-2.0
// Records of the soft mask's kernel. Lengths are kernel units (soft_mask.h) and double where a
// small difference of large coordinates is taken; the vector code sees floats relative to the
// centre of a block of 8x8 pixels. docs/numerics.md: "The distance to a boundary".
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/aligned.h"

namespace tilegrad::raster {

inline constexpr int kBlockSize = 8;  // pixels; faces are set up per block
inline constexpr int kBlockPixels = kBlockSize * kBlockSize;
// Pixels are evaluated in cells, which is also how arrays of a block are ordered: cell by cell, the
// left one of two rows first, and within a cell row by row.
inline constexpr int kCellWidth = 4, kCellHeight = 2;
inline constexpr int kCellPixels = kCellWidth * kCellHeight;
inline constexpr int kCells = kBlockPixels / kCellPixels;
// Members whose products are taken in float before they are merged in double: bounds rounding
// independently of the number of faces.
inline constexpr std::size_t kMergeEvery = 16;

inline constexpr std::size_t CellOf(int x, int y) {
  return static_cast<std::size_t>(y / kCellHeight * (kBlockSize / kCellWidth) + x / kCellWidth);
}
// Where pixel (x, y) of a block stands in arrays.
inline constexpr std::size_t PixelOf(int x, int y) {
  return CellOf(x, y) * kCellPixels +
         static_cast<std::size_t>(y % kCellHeight * kCellWidth + x % kCellWidth);
}

// Pixel centres in a box around (x, y), and from where on a face is far from them.
struct SoftBox {
  double x, y, half_x, half_y;
  double z;      // squared distance of the face's box to this one
  double reach;  // squared distance of (x, y) to the face's boundary
};

// Faces of a tile that are not far from its background, as structure of arrays, seen from the
// tile's centre. A directed edge has the unit direction t and normal n = (-t.y, t.x); the origin
// lies at `side` along n and at `along` along t from the edge's first corner.
struct SoftFaces {
  enum Array { kPosition, kLeft, kTop, kRight, kBottom, kEdges };
  enum EdgeArray { kTx, kTy, kSide, kAlong, kLength, kInverseLength, kEdgeArrays };  // of edge k
  static constexpr std::size_t kArrays = kEdges + 3 * kEdgeArrays;
  static constexpr std::size_t kPadding = 8;  // vectors may reach beyond the end

  AlignedVector<double> values;  // kPosition: in the tile's list
  std::size_t stride = 0, count = 0;

  void Reserve(std::size_t faces) {
    stride = (faces + kPadding + 7) / 8 * 8;
    if (values.size() < kArrays * stride) values.resize(kArrays * stride);
  }
  double* array(std::size_t a) { return values.data() + a * stride; }
  const double* array(std::size_t a) const { return values.data() + a * stride; }
  static constexpr std::size_t Edge(int k, EdgeArray a) {
    return static_cast<std::size_t>(kEdges + k * kEdgeArrays + a);
  }
};

// An edge for the vector code, seen from the centre of a block.
struct SoftBlockEdge {
  float tx, ty, side, along;
  float past;            // along - length, from double
  float inverse_length;  // 0 for an edge of no length, which belongs to its first corner
};
struct SoftBlockFace {
  SoftBlockEdge edge[3];
  std::int32_t position;  // in the tile's list
  std::uint32_t cells;    // bit s: cell s looks at it
};

// One block for the vector code.
struct SoftBlock {
  alignas(64) float x[kBlockPixels], y[kBlockPixels];  // pixel centres from the block's centre
  alignas(64) float cell_x[kCells], cell_y[kCells];    // centres of cells
  float cell_reach;     // a cell drops a face whose z, seen from the cell's centre, is larger
  std::uint32_t cells;  // bit s: cell s has pixels to compute
  SoftBlockFace* members;
  std::size_t count;
  double stop;  // a remaining product up to here may be taken as 0
};

// Forward: alpha in double, 1 for pixels that need not be computed.
struct SoftBlockAlpha {
  alignas(64) double alpha[kBlockPixels];
  std::uint32_t stopped;         // bit s: cell s left out members behind
  std::uint32_t looked[kCells];  // how many members each cell looked at
};

// Backward.
struct SoftBlockGradient {
  alignas(64) float d_alpha[kBlockPixels];  // 0 for pixels that have none
  float* products;                          // [count][kBlockPixels]
  float* d_corners;                         // [6][stride] d_x[3], d_y[3]; added to, per kernel unit
  std::size_t stride;                       // the length of the tile's list
};

}  // namespace tilegrad::raster
