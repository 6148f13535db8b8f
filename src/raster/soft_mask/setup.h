// SPDX-License-Identifier: Apache-2.0
// Records of the soft mask's kernel. Lengths are kernel units (soft_mask.h) unless marked as
// pixels. The vector code uses coordinates relative to the centre of a block's background.
// docs/numerics.md: "The distance to a boundary".
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/aligned.h"
#include "raster/conventions.h"
#include "raster/soft_mask/tree.h"

namespace tilegrad::raster {

inline constexpr std::size_t kBlockSize = 8;  // pixels
inline constexpr std::size_t kBlockPixels = kBlockSize * kBlockSize;
inline constexpr std::size_t kTileBlocks = (kTileSize / kBlockSize) * (kTileSize / kBlockSize);
inline constexpr std::size_t kSoftLanes = 8;  // maximum vector length of this kernel
// Faces that a tile processes before its blocks merge their lanes in double and test whether they
// may stop. Bounds rounding whatever the number of faces.
inline constexpr std::size_t kChunkFaces = 256;
// For the backward pass, which with several chunks has to find the members of blocks twice: for the
// products and for the gradients (docs/benchmarks.md has the cost).
inline constexpr std::size_t kBackwardChunkFaces = 1024;
// Room for one more vector, and padding to 67 cache lines: few arrays a power of two apart fit into
// a cache.
inline constexpr std::size_t kChunkRoom = kBackwardChunkFaces + 6 * kSoftLanes;
// Faces with an edge that spans more than this in x or y are set up in double.
inline constexpr float kLongEdge = 32;  // pixels

// Row m lists the set bits of m, from the lowest.
struct ChosenLanes {
  alignas(64) std::uint8_t lane[1 << kSoftLanes][kSoftLanes] = {};
  constexpr ChosenLanes() {
    for (std::size_t mask = 0; mask < 1 << kSoftLanes; ++mask) {
      std::size_t n = 0;
      for (std::uint8_t i = 0; i < kSoftLanes; ++i) {
        if ((mask >> i & 1) != 0) lane[mask][n++] = i;
      }
    }
  }
};
inline constexpr ChosenLanes kChosenLanes;

// The bounding box of a rectangle's pixel centres.
struct SoftBox {
  float left, top, right, bottom;  // pixels
  float unit_x, unit_y;            // kernel units per pixel
};

// A batch of a tile's faces: corners and the octagon around them in pixels, which is the box and
// the minimum and maximum x + y and x - y; unit direction t of edge k, from corner k to the next,
// and 1 / its length. A zero-length edge has t = (1, 0) and inverse 0. The sine of the turn from
// edge 0 to edge 1, 0 if its sign is uncertain.
struct SoftFaceArrays {
  enum Array {
    kX = 0,
    kY = 3,
    kLeft = 6,
    kTop,
    kRight,
    kBottom,
    kLeastSum,
    kMostSum,
    kLeastDifference,
    kMostDifference,
    kTx,
    kTy = kTx + 3,
    kInverse = kTy + 3,
    kTurn = kInverse + 3,
    kArrays
  };
  alignas(64) float v[kArrays][kChunkRoom];
  alignas(64) std::int32_t face[kChunkRoom];  // of the mesh
  std::size_t count = 0;
};
struct SoftChunk {
  SoftFaceArrays shorts, longs;  // longs have no directions and no diagonals
};

// A block of a tile. Pixels are row by row.
struct SoftBlock {
  int x0, y0, width, height;                       // pixels, clipped to the image
  std::uint64_t bits;                              // of pixels to compute
  std::uint64_t live;                              // those that have not stopped
  SoftBox box;                                     // of those pixels
  float centre_x, centre_y;                        // pixels, its centre
  float half_x, half_y;                            // half its size
  alignas(64) float x[kBlockSize], y[kBlockSize];  // of columns and rows, from the centre
  std::size_t whole;                               // faces evaluated at all pixels
  bool clear;  // no face has been evaluated yet; what follows is not set
  alignas(64) double alpha[kBlockPixels];  // 1 where there is nothing to compute
  // 1 - alpha to relative precision as long as every lane of a chunk keeps at least kLightProduct;
  // else an upper bound. The least product of a lane.
  alignas(64) double product[kBlockPixels];
  alignas(64) float least[kBlockPixels];
};

// Distances at which faces count as far or are dropped. Kernel units.
struct SoftReach {
  float z;              // squared distance at which a face is dropped
  float root;           // its root, plus a margin for rounding
  float near;           // root of kFarZ, likewise: within it A may exceed 1/8
  double share;         // A at z
  float columns, rows;  // the root, pixels
  float diagonals;      // change of x + y or x - y within it, pixels
};

// Members of a block, by the feature nearest to its pixels. Structures of arrays, padded to whole
// vectors with members out of every pixel's reach.
struct SoftList {
  static constexpr std::size_t kRoom = 2 * kChunkRoom + kSoftLanes;
  static constexpr std::int32_t kNoSlot = 2 * kChunkRoom;  // of padding
  alignas(64) std::int32_t slot[kRoom];                    // in the chunk; longs after shorts
  alignas(64) std::int32_t part[kRoom];                    // which corner or edge
  std::size_t count;
};
template <std::size_t kArrays>
struct SoftListOf : SoftList {
  alignas(64) float v[kArrays][kRoom];
};
struct SoftLists {
  enum Edge { kTx, kTy, kSide, kFirst, kLast, kInverse, kEdgeArrays };
  SoftListOf<2> vertices;                  // the nearest point is one corner: x, y
  SoftListOf<kEdgeArrays> segments;        // ... is on one edge
  SoftListOf<3 * kEdgeArrays> boundaries;  // ... is anywhere; edge after edge
  alignas(64) std::uint64_t pixels[SoftList::kNoSlot + 1] = {};  // that see a face, by slot
  std::size_t whole;  // members visible to all pixels to compute

  bool empty() const { return vertices.count + segments.count + boundaries.count == 0; }
};

// dL/d(corners) of a face, pixels.
struct SoftFaceGradient {
  SoftFaceGradient() {}  // no clearing: written next
  float d_corner[3][2];  // x, y
  std::int32_t face;
  std::int32_t unused;  // pads to the length of a vector
};

// Gradients of a face's corners, x and y of each, and padding to quads.
inline constexpr std::size_t kSumRow = 8;

// Backward: a vector of faces near a block, and the product before them.
struct SoftNearFaces {
  SoftNearFaces() {}  // no clearing: much of it is never read
  alignas(64) float edge[3 * SoftLists::kEdgeArrays][kSoftLanes];
  std::int32_t face[kSoftLanes];
  std::size_t count;
  std::uint64_t bits;  // of the pixels that see them
  alignas(64) float before[kBlockPixels];
};

// Nodes near a tile, and the integer part of their squared distance.
struct SoftNodesAt {
  AlignedVector<std::int32_t> node, z;
};

// The groups of the tree near a region.
struct SoftNearGroups {
  SoftBoxes boxes;
  AlignedVector<std::int32_t> group;
  std::size_t count = 0;
};

// Work done, including lanes without a face.
struct SoftWork {
  std::int64_t pairs = 0;   // of a face and a background pixel
  std::int64_t powers = 0;  // 2^-z: one per pair, or one per column and row for corners
};

// Scratch of one worker. Grows to its largest use; then allocates nothing.
struct SoftMaskScratch {
  SoftWork work;  // since the caller last cleared it
  SoftChunk chunk;
  SoftLists lists;
  SoftBlock blocks[kTileBlocks];
  SoftNearGroups groups;
  SoftNodesAt found;
  AlignedVector<std::int32_t> nodes;  // near ones first
  AlignedVector<SoftNearFaces> near[kTileBlocks];
  alignas(
      64) float partial[kBlockPixels][kSoftLanes] = {};  // forward: alpha per lane; 0 between uses
  alignas(64) float sums[2 * kChunkRoom][kSumRow];       // by slot
};

}  // namespace tilegrad::raster
