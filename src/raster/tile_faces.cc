// SPDX-License-Identifier: Apache-2.0
#include "raster/tile_faces.h"

#include <algorithm>
#include <array>

#include "raster/fragments.h"

namespace tilegrad::raster {
namespace {

// Open addressing; twice as many entries as there can be faces.
class SlotTable {
 public:
  SlotTable() { slots_.fill(-1); }

  // The slot of `face`, appended to `tile` if it is new.
  std::int32_t Find(std::int32_t face, float x, float y, TileFaces* tile) {
    std::size_t at = (static_cast<std::uint32_t>(face) * 2654435761u) >> kShift;
    while (slots_[at] >= 0 && tile->face[slots_[at]] != face) at = (at + 1) % slots_.size();
    if (slots_[at] < 0) {
      slots_[at] = tile->count++;
      tile->face[slots_[at]] = face;
      tile->origin_x[slots_[at]] = x, tile->origin_y[slots_[at]] = y;
    }
    return slots_[at];
  }

 private:
  static constexpr int kShift = 32 - 9;
  static_assert(2 * kTilePixels == 1 << (32 - kShift));
  std::array<std::int32_t, 2 * kTilePixels> slots_;
};

}  // namespace

void FindTileFaces(const std::int32_t* pixel_faces, const TileRect& rect, TileFaces* out) {
  SlotTable table;
  out->count = 0;
  std::fill(out->slot, out->slot + kTilePixels, -1);
  for (int i = 0; i < rect.y1 - rect.y0; ++i) {
    std::int32_t last = kNoFace, slot = -1;  // neighbours mostly see the same face
    for (int j = 0; j < rect.x1 - rect.x0; ++j) {
      const std::int32_t face = pixel_faces[i * kTileSize + j];
      if (face != last) {
        last = face;
        slot = face == kNoFace ? -1
                               : table.Find(face, static_cast<float>(rect.x0 + j) + 0.5f,
                                            static_cast<float>(rect.y0 + i) + 0.5f, out);
      }
      out->slot[i * kTileSize + j] = slot;
    }
  }
  for (int s = out->count; s % kTileSize != 0; ++s) {
    out->face[s] = out->face[0];
    out->origin_x[s] = out->origin_x[0], out->origin_y[s] = out->origin_y[0];
  }
}

}  // namespace tilegrad::raster
