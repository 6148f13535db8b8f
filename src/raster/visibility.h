// SPDX-License-Identifier: Apache-2.0
// The visible face at each pixel of a bin (conventions.h, rules 3 and 4). Discrete: no gradient.
#pragma once

#include <cstdint>
#include <span>

#include "raster/bin.h"
#include "raster/coverage.h"
#include "raster/drawn_faces.h"
#include "raster/face_plane.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Pixel arrays of one bin, rows of kBinSize; columns outside the image are background, rows outside
// are unspecified.
struct VisibilityBin {
  // Index into the ScreenMesh, kNoFace: background.
  alignas(128) std::int32_t face[kBinSize * kBinSize];
  alignas(128) float inverse_depth[kBinSize * kBinSize];  // 1/depth; 0 at background
};

// The drawn faces of a mesh that may cover a bin.
struct BinDrawList {
  std::span<const DrawnFace> faces;       // of the image
  std::span<const std::int32_t> indices;  // into them, ascending
};

// Draws a bin: `rect` of BinGrid. The result does not depend on the instruction set: the same bits
// as VisibilityRef<float> everywhere.
void ComputeVisibility(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
                       VisibilityBin* out);

// The same for the faces behind `behind` [kBinSize][kBinSize]: a pixel shows the nearest face whose
// 1/depth is less than its entry. Infinity admits every face, 0 none; the 1/depth of one layer
// yields the next (depth peeling). Of several faces at the same depth only one is ever shown.
void PeelVisibility(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
                    const float* behind, VisibilityBin* out);

// Visibility data of one large face in one tile. Scalar, exact where it decides coverage.

// Pixels are relative to the tile's corner. Edge k at pixel (column, row) is edge[k] + step_x[k] *
// column + step_y[k] * row, and the pixel is covered if none is negative:
// the exact edge functions, divided by kSubpixels and rounded down, which keeps their sign because
// a step of one pixel is a multiple of kSubpixels.
struct TileFaceSetup {
  bool guarded;  // else edge and steps are not set
  std::int32_t edge[3], step_x[3], step_y[3];
  int column_begin, column_end, row_begin, row_end;  // the box, clipped to the tile

  bool CoversTile() const {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t least = edge[k] + (kTileSize - 1) * (step_x[k] < 0 ? step_x[k] : 0) +
                                 (kTileSize - 1) * (step_y[k] < 0 ? step_y[k] : 0);
      if (least < 0) return false;
    }
    return true;
  }
};

// `shape` must be wound clockwise. Returns false if the face's box contains no pixel centre of the
// tile.
bool SetUpTileFace(const SnappedFace& shape, const PixelRect& rect, TileFaceSetup* out);

}  // namespace tilegrad::raster
