// SPDX-License-Identifier: Apache-2.0
// What visibility needs of one large face within one tile. Scalar, exact where coverage is decided.
#pragma once

#include <cstdint>

#include "raster/bin.h"
#include "raster/coverage.h"
#include "raster/face_plane.h"
#include "raster/visibility.h"

namespace tilegrad::raster {

// Pixels are counted from the tile's corner. Edge k at pixel (column, row) is
// edge[k] + step_x[k] * column + step_y[k] * row, and the pixel is covered if none is negative:
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

// `shape` wound clockwise. Returns false if the face's box holds no pixel centre of the tile.
bool SetUpTileFace(const SnappedFace& shape, const PixelRect& rect, TileFaceSetup* out);

}  // namespace tilegrad::raster
