// SPDX-License-Identifier: Apache-2.0
#include "raster/bin.h"

#include <algorithm>
#include <numeric>

#include "raster/chunks.h"

namespace tilegrad::raster {
namespace {

// The tiles of a face. Most have one.
template <class Emit>
void ForEachTile(const TileRange& range, int columns, const Emit& emit) {
  if ((range.columns | range.rows) == 1) {
    emit(static_cast<std::size_t>(range.first));
    return;
  }
  for (int row = 0; row < range.rows; ++row) {
    for (int column = 0; column < range.columns; ++column) {
      emit(static_cast<std::size_t>(range.first + row * columns + column));
    }
  }
}

TileRange RangeOf(const DrawnFace& face, const TileGrid& grid) {
  const int up = (1 << grid.bits) - 1;
  const int column = face.column_begin >> grid.bits, row = face.row_begin >> grid.bits;
  return {row * grid.columns + column,
          static_cast<std::int16_t>(((face.column_end + up) >> grid.bits) - column),
          static_cast<std::int16_t>(((face.row_end + up) >> grid.bits) - row)};
}

// Sets the ranges of the faces of lists [begin, end), and counts them by tile.
void FindRanges(const DrawnFaces& faces, const TileGrid& grid, std::size_t begin, std::size_t end,
                AlignedVector<TileRange>* ranges, std::int32_t* counts) {
  for (std::size_t list = begin; list < end; ++list) {
    TileRange* to = ranges->data() + list * DrawnFaces::kChunk;
    for (const DrawnFace& face : faces.list(list)) {
      *to = RangeOf(face, grid);
      ForEachTile(*to++, grid.columns, [&](std::size_t tile) { ++counts[tile]; });
    }
    const std::size_t next = std::min((list + 1) * DrawnFaces::kChunk, ranges->size());
    std::fill(to, ranges->data() + next, TileRange{0, 0, 0});
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

// A counting sort, which is stable, in chunks of `share` lists: no fewer faces than tiles, or their
// counters would cost more than they.
TileLists SortIntoTiles(const DrawnFaces& faces, const TileGrid& grid, TileListBuffers* buffers,
                        const Workers* workers) {
  constexpr std::size_t kList = DrawnFaces::kChunk;
  const std::size_t n = buffers->ranges.size(), tiles = grid.tiles();
  const std::size_t lists = faces.counts.size(), share = (tiles + kList - 1) / kList;
  buffers->begin.resize(tiles + 1);
  buffers->cursor.assign((lists + share - 1) / share * tiles, 0);
  const auto cursors = [&](std::size_t chunk) { return buffers->cursor.data() + chunk * tiles; };
  ForChunks(workers, lists, share, [&](std::size_t begin, std::size_t end) {
    FindRanges(faces, grid, begin, end, &buffers->ranges, cursors(begin / share));
  });
  PlaceChunks(tiles, buffers);
  buffers->faces.resize(static_cast<std::size_t>(buffers->begin.back()));
  ForChunks(workers, n, share * kList, [&](std::size_t begin, std::size_t end) {
    std::int32_t* const cursor = cursors(begin / (share * kList));
    for (std::size_t f = begin; f < end; ++f) {
      ForEachTile(buffers->ranges[f], grid.columns, [&](std::size_t tile) {
        buffers->faces[static_cast<std::size_t>(cursor[tile]++)] = static_cast<std::int32_t>(f);
      });
    }
  });
  return buffers->View();
}

// All faces into the only tile. Room for as many as there can be: which image comes to which worker
// is not determined, and nothing shall be allocated once every size has been seen.
TileLists ListAll(const DrawnFaces& faces, TileListBuffers* buffers) {
  buffers->faces.clear();
  buffers->faces.reserve(faces.storage.size());
  for (std::size_t chunk = 0; chunk < faces.counts.size(); ++chunk) {
    const std::size_t before = buffers->faces.size();
    buffers->faces.resize(before + faces.counts[chunk]);
    std::iota(buffers->faces.begin() + static_cast<std::ptrdiff_t>(before), buffers->faces.end(),
              static_cast<std::int32_t>(chunk * DrawnFaces::kChunk));
  }
  buffers->begin = {0, static_cast<std::int32_t>(buffers->faces.size())};
  return buffers->View();
}

}  // namespace

TileLists BinDrawnFaces(const DrawnFaces& faces, const TileGrid& grid, TileListBuffers* buffers,
                        const Workers* workers) {
  if (grid.tiles() == 1) return ListAll(faces, buffers);
  const std::size_t lists = faces.counts.size();
  const std::size_t before_last = lists == 0 ? 0 : (lists - 1) * DrawnFaces::kChunk;
  buffers->ranges.resize(lists == 0 ? 0 : before_last + faces.counts.back());
  return SortIntoTiles(faces, grid, buffers, workers);
}

}  // namespace tilegrad::raster
