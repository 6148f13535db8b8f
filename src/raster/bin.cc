// SPDX-License-Identifier: Apache-2.0
#include "raster/bin.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::raster {
namespace {

// Tiles [c0, c1) x [r0, r1).
struct TileRange {
  int c0, r0, c1, r1;
};

// Tiles that hold one of the pixel centres j + 0.5 in [low, high], j in [0, size).
void CentreTiles(float low, float high, int size, int* begin, int* end) {
  const float first = std::max(std::ceil(low - 0.5f), 0.0f);
  const float last = std::min(std::floor(high - 0.5f), static_cast<float>(size - 1));
  const bool any = first <= last;
  *begin = any ? static_cast<int>(first) / kTileSize : 0;
  *end = any ? static_cast<int>(last) / kTileSize + 1 : 0;
}

TileRange FaceTiles(const ScreenMesh& mesh, std::size_t face, const TileGrid& grid, float margin_x,
                    float margin_y) {
  const auto a = static_cast<std::size_t>(mesh.v0[face]);
  const auto b = static_cast<std::size_t>(mesh.v1[face]);
  const auto c = static_cast<std::size_t>(mesh.v2[face]);
  const auto [left, right] = std::minmax({mesh.x[a], mesh.x[b], mesh.x[c]});
  const auto [top, bottom] = std::minmax({mesh.y[a], mesh.y[b], mesh.y[c]});
  TileRange range;
  CentreTiles(left - margin_x, right + margin_x, grid.width, &range.c0, &range.c1);
  CentreTiles(top - margin_y, bottom + margin_y, grid.height, &range.r0, &range.r1);
  return range;
}

// Two passes of a counting sort; `visit(f, emit)` calls emit(tile) for each tile of face f.
template <class Ranges>
TileLists Bin(std::size_t faces, const TileGrid& grid, const Ranges& ranges,
              TileListBuffers* buffers) {
  const auto for_each = [&](auto&& emit) {
    for (std::size_t f = 0; f < faces; ++f) {
      const TileRange r = ranges(f);
      for (int row = r.r0; row < r.r1; ++row) {
        for (int column = r.c0; column < r.c1; ++column) {
          emit(static_cast<std::size_t>(row) * grid.columns + column, f);
        }
      }
    }
  };
  auto& begin = buffers->begin;
  begin.assign(grid.tiles() + 1, 0);
  for_each([&](std::size_t tile, std::size_t) { ++begin[tile + 1]; });
  for (std::size_t t = 0; t < grid.tiles(); ++t) begin[t + 1] += begin[t];
  buffers->cursor.assign(begin.begin(), begin.end() - 1);
  buffers->faces.resize(static_cast<std::size_t>(begin.back()));
  for_each([&](std::size_t tile, std::size_t f) {
    buffers->faces[static_cast<std::size_t>(buffers->cursor[tile]++)] =
        static_cast<std::int32_t>(f);
  });
  return buffers->View();
}

}  // namespace

TileLists BinDrawnFaces(const ScreenMesh& mesh, const TileGrid& grid, TileListBuffers* buffers) {
  // Coverage rounds coordinates by at most half a subpixel.
  constexpr float kRounding = 1.0f / static_cast<float>(kSubpixels);
  return Bin(
      mesh.faces(), grid,
      [&](std::size_t f) {
        if (mesh.reject[f] != kFaceDrawn) return TileRange{0, 0, 0, 0};
        return FaceTiles(mesh, f, grid, kRounding, kRounding);
      },
      buffers);
}

TileLists BinSoftFaces(const ScreenMesh& mesh, const TileGrid& grid, float margin_x, float margin_y,
                       TileListBuffers* buffers) {
  return Bin(
      mesh.faces(), grid,
      [&](std::size_t f) {
        if ((mesh.reject[f] & kFaceNotInSoftMask) != 0) return TileRange{0, 0, 0, 0};
        return FaceTiles(mesh, f, grid, margin_x, margin_y);
      },
      buffers);
}

}  // namespace tilegrad::raster
