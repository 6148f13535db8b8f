// SPDX-License-Identifier: Apache-2.0
#include "raster/bin.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/bin.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/bin-inl.h"

#if HWY_ONCE
#include <numeric>

namespace tilegrad::raster {
namespace {

HWY_EXPORT(FaceTiles);

template <class Emit>
void ForEachTile(const AlignedVector<TileRange>& ranges, int columns, const Emit& emit) {
  for (std::size_t f = 0; f < ranges.size(); ++f) {
    const TileRange r = ranges[f];
    for (int row = r.row_begin; row < r.row_end; ++row) {
      for (int column = r.column_begin; column < r.column_end; ++column) {
        emit(static_cast<std::size_t>(row * columns + column), static_cast<std::int32_t>(f));
      }
    }
  }
}

// A counting sort of buffers->ranges, which is stable.
TileLists SortIntoTiles(const TileGrid& grid, TileListBuffers* buffers) {
  auto& begin = buffers->begin;
  begin.assign(grid.tiles() + 1, 0);
  ForEachTile(buffers->ranges, grid.columns,
              [&](std::size_t tile, std::int32_t) { ++begin[tile + 1]; });
  for (std::size_t t = 0; t < grid.tiles(); ++t) begin[t + 1] += begin[t];
  buffers->cursor.assign(begin.begin(), begin.end() - 1);
  buffers->faces.resize(static_cast<std::size_t>(begin.back()));
  ForEachTile(buffers->ranges, grid.columns, [&](std::size_t tile, std::int32_t f) {
    buffers->faces[static_cast<std::size_t>(buffers->cursor[tile]++)] = f;
  });
  return buffers->View();
}

}  // namespace

TileLists BinDrawnFaces(std::span<const DrawnFace> faces, const TileGrid& grid,
                        TileListBuffers* buffers) {
  if (grid.tiles() == 1) {
    buffers->begin = {0, static_cast<std::int32_t>(faces.size())};
    buffers->faces.resize(faces.size());
    std::iota(buffers->faces.begin(), buffers->faces.end(), 0);
    return buffers->View();
  }
  const int up = (1 << grid.bits) - 1;
  buffers->ranges.resize(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const DrawnFace& f = faces[i];
    buffers->ranges[i] = {static_cast<std::int16_t>(f.column_begin >> grid.bits),
                          static_cast<std::int16_t>((f.column_end + up) >> grid.bits),
                          static_cast<std::int16_t>(f.row_begin >> grid.bits),
                          static_cast<std::int16_t>((f.row_end + up) >> grid.bits)};
  }
  return SortIntoTiles(grid, buffers);
}

TileLists BinSoftFaces(const ScreenMesh& mesh, const TileGrid& grid, float margin_x, float margin_y,
                       TileListBuffers* buffers) {
  buffers->ranges.resize(mesh.faces());
  if (mesh.faces() > 0) {
    HWY_DYNAMIC_DISPATCH(FaceTiles)
    (mesh, grid, {margin_x, margin_y, kFaceNotInSoftMask}, buffers->ranges.data());
  }
  return SortIntoTiles(grid, buffers);
}

}  // namespace tilegrad::raster
#endif
