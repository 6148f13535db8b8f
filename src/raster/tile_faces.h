// SPDX-License-Identifier: Apache-2.0
// The faces seen in one tile, numbered: what is per face is then set up once per tile, and
// gradients are summed per face before they leave the tile.
#pragma once

#include <cstdint>

#include "raster/bin.h"
#include "raster/conventions.h"

namespace tilegrad::raster {

inline constexpr int kTilePixels = kTileSize * kTileSize;

// Pixel arrays of a tile are [kTileSize][kTileSize], row by row, whatever part of it is inside of
// the image; pixels outside of the image are background.
struct TileFaces {
  // Slot arrays are filled up to a multiple of kTileSize with copies of slot 0, for whole vectors.
  int count = 0;  // faces seen
  // Per pixel: index below, -1 at background. A row more, which is scratch of FindTileFaces.
  alignas(128) std::int32_t slot[kTilePixels + kTileSize];
  alignas(128) std::int32_t face[kTilePixels];  // per slot, in order of first appearance
  // Per slot: the centre of the first pixel it is seen in. Positions relative to it keep the digits
  // of tiny faces.
  alignas(128) float origin_x[kTilePixels], origin_y[kTilePixels];
};

// Numbers the faces of `pixel_faces` (kNoFace: background, also beyond `rect`) in the order of
// first appearance. One number beyond the array is read.
void FindTileFaces(const std::int32_t* pixel_faces, const TileRect& rect, TileFaces* out);

}  // namespace tilegrad::raster
