// SPDX-License-Identifier: Apache-2.0
#include "raster/bin.h"

#include <algorithm>
#include <numeric>

#include "raster/chunks.h"

namespace tilegrad::raster {
namespace {

// The tiles of faces [begin, end).
template <class Emit>
void ForEachTile(const AlignedVector<TileRange>& ranges, std::size_t begin, std::size_t end,
                 int columns, const Emit& emit) {
  for (std::size_t f = begin; f < end; ++f) {
    const TileRange r = ranges[f];
    for (int row = r.row_begin; row < r.row_end; ++row) {
      for (int column = r.column_begin; column < r.column_end; ++column) {
        emit(static_cast<std::size_t>(row * columns + column), static_cast<std::int32_t>(f));
      }
    }
  }
}

// From the number of each chunk's faces per tile to where they go: sets `begin` and `cursor`.
void PlaceChunks(std::size_t tiles, TileListBuffers* buffers) {
  std::int32_t total = 0;
  for (std::size_t t = 0; t < tiles; ++t) {
    buffers->begin[t] = total;
    for (std::size_t at = t; at < buffers->cursor.size(); at += tiles) {
      const std::int32_t count = buffers->cursor[at];
      buffers->cursor[at] = total, total += count;
    }
  }
  buffers->begin[tiles] = total;
}

// A counting sort of buffers->ranges, which is stable, in chunks of faces.
TileLists SortIntoTiles(const TileGrid& grid, TileListBuffers* buffers, const Workers* workers) {
  const std::size_t n = buffers->ranges.size(), tiles = grid.tiles();
  const std::size_t chunk = std::max(DrawnFaces::kChunk, tiles);
  buffers->begin.resize(tiles + 1);
  buffers->cursor.assign((n + chunk - 1) / chunk * tiles, 0);
  const auto cursors = [&](std::size_t begin) {
    return buffers->cursor.data() + begin / chunk * tiles;
  };
  ForChunks(workers, n, chunk, [&](std::size_t begin, std::size_t end) {
    std::int32_t* const counts = cursors(begin);
    ForEachTile(buffers->ranges, begin, end, grid.columns,
                [&](std::size_t tile, std::int32_t) { ++counts[tile]; });
  });
  PlaceChunks(tiles, buffers);
  buffers->faces.resize(static_cast<std::size_t>(buffers->begin.back()));
  ForChunks(workers, n, chunk, [&](std::size_t begin, std::size_t end) {
    std::int32_t* const cursor = cursors(begin);
    ForEachTile(buffers->ranges, begin, end, grid.columns, [&](std::size_t tile, std::int32_t f) {
      buffers->faces[static_cast<std::size_t>(cursor[tile]++)] = f;
    });
  });
  return buffers->View();
}

// All faces into the only tile.
TileLists ListAll(const DrawnFaces& faces, TileListBuffers* buffers) {
  buffers->faces.clear();
  for (std::size_t chunk = 0; chunk < faces.counts.size(); ++chunk) {
    const std::size_t before = buffers->faces.size();
    buffers->faces.resize(before + faces.counts[chunk]);
    std::iota(buffers->faces.begin() + static_cast<std::ptrdiff_t>(before), buffers->faces.end(),
              static_cast<std::int32_t>(chunk * DrawnFaces::kChunk));
  }
  buffers->begin = {0, static_cast<std::int32_t>(buffers->faces.size())};
  return buffers->View();
}

TileRange RangeOf(const DrawnFace& face, int bits) {
  const int up = (1 << bits) - 1;
  return {static_cast<std::int16_t>(face.column_begin >> bits),
          static_cast<std::int16_t>((face.column_end + up) >> bits),
          static_cast<std::int16_t>(face.row_begin >> bits),
          static_cast<std::int16_t>((face.row_end + up) >> bits)};
}

}  // namespace

TileLists BinDrawnFaces(const DrawnFaces& faces, const TileGrid& grid, TileListBuffers* buffers,
                        const Workers* workers) {
  if (grid.tiles() == 1) return ListAll(faces, buffers);
  constexpr std::size_t kChunk = DrawnFaces::kChunk;
  const std::size_t chunks = faces.counts.size();
  buffers->ranges.resize(chunks == 0 ? 0 : (chunks - 1) * kChunk + faces.counts.back());
  ForChunks(workers, buffers->ranges.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    TileRange* to = buffers->ranges.data() + begin;
    for (const DrawnFace& face : faces.list(begin / kChunk)) *to++ = RangeOf(face, grid.bits);
    std::fill(to, buffers->ranges.data() + end, TileRange{0, 0, 0, 0});
  });
  return SortIntoTiles(grid, buffers, workers);
}

}  // namespace tilegrad::raster
