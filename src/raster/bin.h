// SPDX-License-Identifier: Apache-2.0
// Faces into tiles: which faces have to be looked at for which tile. Order is stable: within a
// tile, faces ascend, which is what the tie rule and deterministic sums rest on.
#pragma once

#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "raster/conventions.h"
#include "raster/drawn_faces.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Pixels [x0, x1) x [y0, y1).
struct TileRect {
  int x0, y0, x1, y1;
};

// One face list per tile, as compressed rows: tile t holds faces[begin[t]] .. faces[begin[t+1]-1].
struct TileLists {
  std::span<const std::int32_t> begin;  // [tiles + 1]
  std::span<const std::int32_t> faces;  // indices into what was binned, ascending within a tile

  std::span<const std::int32_t> operator[](std::size_t tile) const {
    const auto from = static_cast<std::size_t>(begin[tile]);
    return faces.subspan(from, static_cast<std::size_t>(begin[tile + 1]) - from);
  }
};

// The tiles of one image, row by row; the last column and row may be narrower.
struct TileGrid {
  int width = 0, height = 0;  // pixels
  int columns = 0, rows = 0;  // tiles

  TileGrid() = default;
  TileGrid(int w, int h)
      : width(w),
        height(h),
        columns((w + kTileSize - 1) / kTileSize),
        rows((h + kTileSize - 1) / kTileSize) {}
  std::size_t tiles() const { return static_cast<std::size_t>(columns) * rows; }
  TileRect rect(std::size_t tile) const {
    const int x0 = static_cast<int>(tile % columns) * kTileSize;
    const int y0 = static_cast<int>(tile / columns) * kTileSize;
    return {x0, y0, x0 + kTileSize < width ? x0 + kTileSize : width,
            y0 + kTileSize < height ? y0 + kTileSize : height};
  }
};

// Tiles [column_begin, column_end) x [row_begin, row_end) of a face.
struct TileRange {
  std::int16_t column_begin, column_end, row_begin, row_end;
};

// How far a face reaches, in pixels, and the bits of FaceReject that keep it out of the lists.
struct BinMargin {
  float x, y;
  std::uint8_t reject;
};

// Owns the memory of a TileLists; reused from frame to frame.
struct TileListBuffers {
  AlignedVector<std::int32_t> begin, faces, cursor;
  AlignedVector<TileRange> ranges;
  TileLists View() const { return {begin, faces}; }
};

// Lists every drawn face (its index in `faces`) for each tile in which its box holds a pixel
// centre.
TileLists BinDrawnFaces(std::span<const DrawnFace> faces, const TileGrid& grid,
                        TileListBuffers* buffers);

// Lists every face that takes part in the soft mask (drawn, culled or degenerate) for each tile
// that has a pixel centre within `margin_x`, `margin_y` (pixels, >= 0, may be infinite) of its box.
TileLists BinSoftFaces(const ScreenMesh& mesh, const TileGrid& grid, float margin_x, float margin_y,
                       TileListBuffers* buffers);

}  // namespace tilegrad::raster
