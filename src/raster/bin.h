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

// Calls visit(rect) for the tiles of a rectangle that begins where a tile does.
template <class Visit>
void ForTiles(const TileRect& rect, const Visit& visit) {
  for (int y = rect.y0; y < rect.y1; y += kTileSize) {
    for (int x = rect.x0; x < rect.x1; x += kTileSize) {
      visit(TileRect{x, y, x + kTileSize < rect.x1 ? x + kTileSize : rect.x1,
                     y + kTileSize < rect.y1 ? y + kTileSize : rect.y1});
    }
  }
}

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
  int bits = kTileBits;       // a tile is 1 << bits pixels wide and high
  int columns = 0, rows = 0;  // tiles

  TileGrid() = default;
  TileGrid(int w, int h, int tile_bits = kTileBits)
      : width(w),
        height(h),
        bits(tile_bits),
        columns((w + (1 << bits) - 1) >> bits),
        rows((h + (1 << bits) - 1) >> bits) {}
  std::size_t tiles() const { return static_cast<std::size_t>(columns) * rows; }
  TileRect rect(std::size_t tile) const {
    const int x0 = static_cast<int>(tile % columns) << bits, size = 1 << bits;
    const int y0 = static_cast<int>(tile / columns) << bits;
    return {x0, y0, x0 + size < width ? x0 + size : width, y0 + size < height ? y0 + size : height};
  }
  // The tile that pixel (x, y) lies in.
  std::size_t tile(int x, int y) const {
    return static_cast<std::size_t>(y >> bits) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(x >> bits);
  }
};
// Faces are drawn by bins.
inline TileGrid BinGrid(int width, int height) { return {width, height, kBinBits}; }

// Owns the memory of a TileLists; reused from frame to frame.
struct TileListBuffers {
  AlignedVector<std::int32_t> begin, faces;
  AlignedVector<std::int32_t> cursor;  // [chunks of faces][tiles] where a chunk's next face goes
  TileLists View() const { return {begin, faces}; }
};

// Lists every drawn face (its index in `faces.storage`) for each bin in which its box holds a pixel
// centre. `bins`: BinGrid of the faces' image. `workers` null: the calling thread.
TileLists BinDrawnFaces(const DrawnFaces& faces, const TileGrid& bins, TileListBuffers* buffers,
                        const Workers* workers = nullptr);

}  // namespace tilegrad::raster
