// SPDX-License-Identifier: Apache-2.0
// The blocks of a tile: which pixels are background, and where they lie.

#if defined(TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_BLOCK_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstddef>

#include "base/prefetch.h"
#include "raster/soft_mask/nodes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {

HWY_INLINE std::size_t PixelIndex(const SoftMaskPlan& plan, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(plan.width) +
         static_cast<std::size_t>(x);
}

// Where a block begins in SoftMaskImages::transmittance; its rows follow, `width` numbers each.
HWY_INLINE std::size_t TransmittanceIndex(const SoftMaskPlan& plan, const SoftBlock& block) {
  return static_cast<std::size_t>(block.y0) * static_cast<std::size_t>(plan.width) +
         static_cast<std::size_t>(block.x0) * static_cast<std::size_t>(block.height);
}

// The tile after `tile` in `region`, as ForTiles goes; empty behind the last one.
HWY_INLINE PixelRect NextTile(const PixelRect& region, const PixelRect& tile) {
  const bool right = tile.x1 < region.x1;
  const int x = right ? tile.x1 : region.x0, y = right ? tile.y0 : tile.y1;
  return {x, y, HWY_MIN(x + kTileSize, region.x1), HWY_MIN(y + kTileSize, region.y1)};
}

// Prefetches a tile of an image, row by row.
template <class T>
HWY_INLINE void PrefetchTile(const SoftMaskPlan& plan, const PixelRect& tile, const T* image) {
  for (int y = tile.y0; y < tile.y1; ++y) {
    PrefetchLine(image + PixelIndex(plan, tile.x0, y));
    PrefetchLine(image + PixelIndex(plan, tile.x1 - 1, y));
  }
}

// Calls visit(pixel of the image, pixel of the block) for the first pixel of each row.
template <class Visit>
HWY_INLINE void ForRows(const SoftMaskPlan& plan, const SoftBlock& block, const Visit& visit) {
  for (int y = 0; y < block.height; ++y) {
    visit(PixelIndex(plan, block.x0, block.y0 + y), static_cast<std::size_t>(y) * kBlockSize);
  }
}

// Lanes are the pixels of a row of a tile.
using TileTag = hn::CappedTag<float, kTileSize>;
using TileIntTag = hn::RebindToSigned<TileTag>;

// Some pixels of a tile, as bits of its blocks.
class TilePixels {
 public:
  // Those in whose lanes chosen(index in the image) is true, which is asked for whole vectors, and
  // at the right side of the image for one(index in the image).
  template <class Chosen, class One>
  HWY_INLINE TilePixels(const SoftMaskPlan& plan, const PixelRect& rect, const Chosen& chosen,
                        const One& one) {
    const TileTag d;
    const auto width = static_cast<std::size_t>(rect.x1 - rect.x0);
    const auto row_at = [&](int y) HWY_ATTR {
      const std::size_t from = PixelIndex(plan, rect.x0, y);
      std::uint64_t row = 0;
      if (width == static_cast<std::size_t>(kTileSize)) {
        for (std::size_t x = 0; x < width; x += hn::Lanes(d)) {
          row |= std::uint64_t{BitsOf(d, chosen(from + x))} << x;
        }
      } else {
        for (std::size_t x = 0; x < width; ++x) row |= std::uint64_t{one(from + x)} << x;
      }
      return row;
    };
    for (std::size_t b = 0; b < kTileBlocks; b += 2) {
      std::uint64_t left = 0, right = 0;  // not in memory, as the array is
      const int y0 = rect.y0 + static_cast<int>(b / 2 * kBlockSize);
      const int rows = HWY_MIN(rect.y1 - y0, static_cast<int>(kBlockSize));
      for (int y = 0; y < rows; ++y) {
        const std::uint64_t row = row_at(y0 + y);
        left |= (row & 0xff) << y * kBlockSize;
        right |= row >> kBlockSize << y * kBlockSize;
      }
      bits_[b] = left;
      bits_[b + 1] = right;
    }
  }

  bool none() const { return (bits_[0] | bits_[1] | bits_[2] | bits_[3]) == 0; }
  // Bits of block b.
  std::uint64_t of(std::size_t b) const { return bits_[b]; }
  // Bits of row y.
  std::uint32_t row(std::size_t y) const {
    const std::size_t b = y / kBlockSize * 2, from = y % kBlockSize * kBlockSize;
    return static_cast<std::uint32_t>((bits_[b] >> from & 0xff) | (bits_[b + 1] >> from & 0xff)
                                                                      << kBlockSize);
  }

 private:
  static_assert(kTileBlocks == 4);
  std::uint64_t bits_[kTileBlocks] = {};
};

// The background of a tile.
HWY_INLINE TilePixels BackgroundOf(const SoftMaskPlan& plan, const SoftMaskRegion& tile) {
  const std::int32_t* ids = tile.face_ids.data();
  return TilePixels(
      plan, tile.rect,
      [&](std::size_t i) HWY_ATTR {
        const TileIntTag di;
        return hn::RebindMask(TileTag(), hn::Lt(hn::LoadU(di, ids + i), hn::Zero(di)));
      },
      [&](std::size_t i) { return ids[i] < 0; });
}

// Bit x: some row has column x. Bit y: row y has a pixel.
HWY_INLINE std::uint32_t ColumnsOf(std::uint64_t bits) {
  for (const int shift : {32, 16, 8}) bits |= bits >> shift;
  return static_cast<std::uint32_t>(bits & 0xff);
}
HWY_INLINE std::uint32_t RowsOf(std::uint64_t bits) {
  for (const int shift : {4, 2, 1}) bits |= bits >> shift;
  // The lowest bit of each row to bits 56, 57, ... in turn.
  return static_cast<std::uint32_t>((bits & 0x0101010101010101u) * 0x0102040810204080u >> 56);
}

// The bounding box of the block's pixels to compute.
HWY_INLINE PixelRect BoxOf(const SoftBlock& block) {
  const std::uint32_t columns = ColumnsOf(block.bits), rows = RowsOf(block.bits);
  return {block.x0 + std::countr_zero(columns), block.y0 + std::countr_zero(rows),
          block.x0 + static_cast<int>(std::bit_width(columns)),
          block.y0 + static_cast<int>(std::bit_width(rows))};
}

// Everything that follows from block.bits, of which `rect` is the bounding box.
HWY_INLINE void PlaceBlock(const SoftMaskPlan& plan, const PixelRect& rect, SoftBlock* block) {
  const SoftBox& unit = block->box = CentresOf(rect, plan);
  block->live = block->bits;
  block->whole = 0;
  block->centre_x = 0.5f * static_cast<float>(rect.x0 + rect.x1);
  block->centre_y = 0.5f * static_cast<float>(rect.y0 + rect.y1);
  block->half_x = 0.5f * static_cast<float>(rect.x1 - 1 - rect.x0) * unit.unit_x;
  block->half_y = 0.5f * static_cast<float>(rect.y1 - 1 - rect.y0) * unit.unit_y;
  for (std::size_t i = 0; i < kBlockSize; ++i) {
    const float at = static_cast<float>(i) + 0.5f;
    block->x[i] = (static_cast<float>(block->x0) + at - block->centre_x) * unit.unit_x;
    block->y[i] = (static_cast<float>(block->y0) + at - block->centre_y) * unit.unit_y;
  }
}

// The blocks of a tile, and the box around all pixels to compute. bits_of(block, its number) says
// which.
template <class Bits>
HWY_INLINE SoftBox SetUpBlocks(const SoftMaskPlan& plan, const PixelRect& rect, const Bits& bits_of,
                               SoftBlock* blocks) {
  PixelRect all{rect.x1, rect.y1, rect.x0, rect.y0};
  for (std::size_t b = 0; b < kTileBlocks; ++b) {
    SoftBlock& block = blocks[b];
    block.x0 = rect.x0 + static_cast<int>(b % 2 * kBlockSize);
    block.y0 = rect.y0 + static_cast<int>(b / 2 * kBlockSize);
    block.width = std::clamp(rect.x1 - block.x0, 0, static_cast<int>(kBlockSize));
    block.height = std::clamp(rect.y1 - block.y0, 0, static_cast<int>(kBlockSize));
    block.bits = block.width == 0 ? 0 : bits_of(block, b);
    block.live = 0;
    block.clear = true;
    if (block.bits == 0) continue;
    const PixelRect own = BoxOf(block);
    PlaceBlock(plan, own, &block);
    all = {std::min(all.x0, own.x0), std::min(all.y0, own.y0), std::max(all.x1, own.x1),
           std::max(all.y1, own.y1)};
  }
  return CentresOf(all, plan);
}

HWY_INLINE bool AnyLive(const SoftBlock* blocks) {
  return std::any_of(blocks, blocks + kTileBlocks, [](const SoftBlock& b) { return b.live != 0; });
}

// Fills the arrays per pixel of a block. With vectors: compilers would choose rep stos, which is
// slow to start.
template <class T>
HWY_INLINE void FillPixels(T value, T* to) {
  const hn::CappedTag<T, kBlockSize> d;
  for (std::size_t i = 0; i < kBlockPixels; i += hn::Lanes(d))
    hn::Store(hn::Set(d, value), d, to + i);
}

// Alpha of a block over no faces: 0 for the pixels to compute.
HWY_INLINE void ClearAlpha(SoftBlock* block) {
  block->clear = false;
  FillPixels(0.0, block->alpha);
  FillPixels(1.0, block->product);
  FillPixels(1.0f, block->least);
  for (std::uint64_t others = ~block->bits; others != 0; others &= others - 1) {
    const int i = std::countr_zero(others);
    block->alpha[i] = 1;
    block->product[i] = 0;
  }
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
