// SPDX-License-Identifier: Apache-2.0
// Vector body of tile_faces.h. Rows are cut into runs of one face; only their first pixels are
// looked up.
#if defined(TILEGRAD_RASTER_TILE_FACES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_TILE_FACES_INL_H_
#undef TILEGRAD_RASTER_TILE_FACES_INL_H_
#else
#define TILEGRAD_RASTER_TILE_FACES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "raster/fragments.h"
#include "raster/tile_faces.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SlotTag = HWY_CAPPED(std::int32_t, kTileSize);

HWY_INLINE void FillRow(std::int32_t value, std::int32_t* to) {
  const SlotTag d;
  for (std::size_t j = 0; j < kTileSize; j += hn::Lanes(d))
    hn::StoreU(hn::Set(d, value), d, to + j);
}

// Bit j of the row: pixel j is the first, or sees another face than pixel j - 1. Reads one pixel
// beyond the row.
HWY_INLINE std::uint32_t RunStarts(const std::int32_t* faces) {
  const SlotTag d;
  std::uint32_t ends = 0;
  for (std::size_t j = 0; j < kTileSize; j += hn::Lanes(d)) {
    const auto same = hn::Eq(hn::LoadU(d, faces + j), hn::LoadU(d, faces + j + 1));
    std::uint8_t mask[8] = {};
    hn::StoreMaskBits(d, hn::Not(same), mask);
    ends |= (static_cast<std::uint32_t>(mask[0]) | static_cast<std::uint32_t>(mask[1]) << 8) << j;
  }
  return (ends << 1 | 1) & ((1u << kTileSize) - 1);
}

// Open addressing; twice as many entries as there can be faces.
class SlotTable {
 public:
  SlotTable() {
    for (std::size_t i = 0; i < kEntries; i += kTileSize) FillRow(-1, slots_ + i);
  }

  // The slot of `face`, appended to `tile` if it is new, with pixel (x, y) as its origin.
  std::int32_t Find(std::int32_t face, float x, float y, TileFaces* tile) {
    std::size_t at = (static_cast<std::uint32_t>(face) * 2654435761u) >> kShift;
    while (slots_[at] >= 0 && tile->face[slots_[at]] != face) at = (at + 1) % kEntries;
    if (slots_[at] < 0) {
      slots_[at] = tile->count++;
      tile->face[slots_[at]] = face;
      tile->origin_x[slots_[at]] = x, tile->origin_y[slots_[at]] = y;
    }
    return slots_[at];
  }

 private:
  static constexpr int kShift = 32 - 9;
  static constexpr std::size_t kEntries = 2 * kTilePixels;
  static_assert(kEntries == 1 << (32 - kShift));
  HWY_ALIGN std::int32_t slots_[kEntries];
};

void NumberFaces(const std::int32_t* pixel_faces, const TileRect& rect, TileFaces* out) {
  SlotTable table;
  out->count = 0;
  for (int i = 0; i < kTileSize; ++i) {
    const std::int32_t* row = pixel_faces + i * kTileSize;
    std::int32_t* const slots = out->slot + i * kTileSize;
    FillRow(-1, slots);
    for (std::uint32_t starts = RunStarts(row); starts != 0; starts &= starts - 1) {
      const auto j = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(starts));
      std::int32_t slot = -1;
      if (row[j] != kNoFace) {
        slot = i > 0 && row[j - kTileSize] == row[j]
                   ? slots[j - kTileSize]
                   : table.Find(row[j], static_cast<float>(rect.x0 + j) + 0.5f,
                                static_cast<float>(rect.y0 + i) + 0.5f, out);
      }
      FillRow(slot, slots + j);  // the next run and the next row write over what is too much
    }
  }
  for (int s = out->count; s % kTileSize != 0; ++s) {
    out->face[s] = out->face[0];
    out->origin_x[s] = out->origin_x[0], out->origin_y[s] = out->origin_y[0];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif
