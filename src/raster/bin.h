// SPDX-License-Identifier: Apache-2.0
// Binning: lists the faces that each bin has to process. Stable: faces ascend within a bin, as the
// tie rule and deterministic sums require.
#pragma once

#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "raster/conventions.h"
#include "raster/drawn_faces.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Pixels [x0, x1) x [y0, y1).
struct PixelRect {
  int x0, y0, x1, y1;
};

// Calls visit(rect) for the tiles of a rectangle, which must start on a tile boundary.
template <class Visit>
void ForTiles(const PixelRect& rect, const Visit& visit) {
  for (int y = rect.y0; y < rect.y1; y += kTileSize) {
    for (int x = rect.x0; x < rect.x1; x += kTileSize) {
      visit(PixelRect{x, y, x + kTileSize < rect.x1 ? x + kTileSize : rect.x1,
                      y + kTileSize < rect.y1 ? y + kTileSize : rect.y1});
    }
  }
}

// One face list per bin, as compressed rows: bin b holds faces[begin[b]] .. faces[begin[b+1]-1].
struct BinLists {
  std::span<const std::int32_t> begin;  // [bins + 1]
  std::span<const std::int32_t> faces;  // indices into the binned faces, ascending within a bin

  std::span<const std::int32_t> operator[](std::size_t bin) const {
    const auto from = static_cast<std::size_t>(begin[bin]);
    return faces.subspan(from, static_cast<std::size_t>(begin[bin + 1]) - from);
  }
};

// An image divided into squares, bins or tiles, row by row; the last column and row may be
// narrower.
struct SquareGrid {
  int width = 0, height = 0;  // pixels
  int bits = kTileBits;       // a cell is 1 << bits pixels wide and high
  int columns = 0, rows = 0;  // cells

  SquareGrid() = default;
  SquareGrid(int w, int h, int cell_bits)
      : width(w),
        height(h),
        bits(cell_bits),
        columns((w + (1 << bits) - 1) >> bits),
        rows((h + (1 << bits) - 1) >> bits) {}
  std::size_t cells() const { return static_cast<std::size_t>(columns) * rows; }
  PixelRect rect(std::size_t cell) const {
    const int x0 = static_cast<int>(cell % columns) << bits, size = 1 << bits;
    const int y0 = static_cast<int>(cell / columns) << bits;
    return {x0, y0, x0 + size < width ? x0 + size : width, y0 + size < height ? y0 + size : height};
  }
  // The cell of pixel (x, y).
  std::size_t cell(int x, int y) const {
    return static_cast<std::size_t>(y >> bits) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(x >> bits);
  }
};
inline SquareGrid BinGrid(int width, int height) { return {width, height, kBinBits}; }
inline SquareGrid TileGrid(int width, int height) { return {width, height, kTileBits}; }

// The memory behind a BinLists; reused from frame to frame.
struct BinListBuffers {
  AlignedVector<std::int32_t> begin, faces;
  AlignedVector<std::int32_t> cursor;  // [chunks of faces][bins] position of a chunk's next face
  BinLists View() const { return {begin, faces}; }
};

// Lists every drawn face (its index in `faces.storage`) in each bin where its box contains a pixel
// centre. `bins`: BinGrid of the faces' image. `workers` null: the calling thread.
BinLists BinDrawnFaces(const DrawnFaces& faces, const SquareGrid& bins, BinListBuffers* buffers,
                       const Workers* workers = nullptr);

}  // namespace tilegrad::raster
