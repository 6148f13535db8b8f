// SPDX-License-Identifier: Apache-2.0
#include "raster/soft_mask.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "raster/soft_mask_block.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/soft_mask.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "raster/soft_mask-inl.h"
#include "raster/soft_mask_gather-inl.h"

#if HWY_ONCE

namespace tilegrad::raster {
HWY_EXPORT(SoftTileFaces);
HWY_EXPORT(SoftBlockMembers);
HWY_EXPORT(SoftMaskBlockTarget);
HWY_EXPORT(SoftMaskBlockBackwardTarget);

namespace {

constexpr int kTileBlocks = (kTileSize / kBlockSize) * (kTileSize / kBlockSize);

// A block of a tile and which of its pixels are background: bit 8 y + x.
struct Background {
  TileRect rect;       // the block, cut off by the image
  std::uint64_t bits;  // of all kBlockPixels
  TileRect box;        // the smallest rectangle with all of them
};

std::size_t PixelIndex(const SoftMaskPlan& plan, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(plan.width) +
         static_cast<std::size_t>(x);
}

Background FindBackground(const SoftMaskPlan& plan, const SoftMaskTile& tile,
                          const TileRect& rect) {
  std::uint64_t bits = 0;
  std::uint32_t columns = 0;
  for (int y = rect.y0; y < rect.y1; ++y) {
    const std::int32_t* ids = tile.face_ids.data() + PixelIndex(plan, rect.x0, y);
    std::uint32_t row = 0;
    for (int x = 0; x < rect.x1 - rect.x0; ++x) {
      row |= static_cast<std::uint32_t>(ids[x] < 0) << x;
    }
    columns |= row;
    bits |= static_cast<std::uint64_t>(row) << (kBlockSize * (y - rect.y0));
  }
  if (bits == 0) return {rect, 0, {rect.x1, rect.y1, rect.x0, rect.y0}};
  return {rect,
          bits,
          {rect.x0 + std::countr_zero(columns), rect.y0 + std::countr_zero(bits) / kBlockSize,
           rect.x0 + static_cast<int>(std::bit_width(columns)),
           rect.y0 + static_cast<int>(std::bit_width(bits) + kBlockSize - 1) / kBlockSize}};
}

// A tile as its blocks see it.
class TileBlocks {
 public:
  TileBlocks(const SoftMaskPlan& plan, const SoftMaskTile& tile)
      : plan_(plan), tile_(tile), frame_(FrameOf(plan, tile.rect)) {
    TileRect& box = box_;
    for (int y = tile.rect.y0; y < tile.rect.y1; y += kBlockSize) {
      for (int x = tile.rect.x0; x < tile.rect.x1; x += kBlockSize) {
        const TileRect rect{x, y, std::min(x + kBlockSize, tile.rect.x1),
                            std::min(y + kBlockSize, tile.rect.y1)};
        const Background& b = block_[count_++] = FindBackground(plan, tile, rect);
        box = {std::min(box.x0, b.box.x0), std::min(box.y0, b.box.y0), std::max(box.x1, b.box.x1),
               std::max(box.y1, b.box.y1)};
      }
    }
  }
  bool HasBackground() const { return box_.x1 > box_.x0; }
  std::span<const Background> blocks() const { return {block_, count_}; }

  // Keeps the tile's faces in scratch and prepares `block` for its blocks.
  void SetUp(const ScreenMesh& mesh, SoftMaskScratch* scratch, SoftBlock* block) const {
    const double z = DropZ(tile_.faces.size(), plan_.cull_error);
    HWY_DYNAMIC_DISPATCH(SoftTileFaces)
    (mesh, frame_, tile_.faces, BoxOf(frame_, box_, z), &scratch->faces);
    if (scratch->members.size() < scratch->faces.count) {
      scratch->members.resize(scratch->faces.count);
    }
    SetUpBlock(frame_, z, block);
  }

  // The members of one block.
  void Gather(const Background& pixels, SoftMaskScratch* scratch, SoftBlock* block) const {
    const double z = DropZ(tile_.faces.size(), plan_.cull_error);
    const SoftPoint centre =
        ToUnits(frame_, pixels.rect.x0 + 0.5 * kBlockSize, pixels.rect.y0 + 0.5 * kBlockSize);
    block->members = scratch->members.data();
    block->count = HWY_DYNAMIC_DISPATCH(SoftBlockMembers)(
        scratch->faces, BoxOf(frame_, pixels.box, z), centre, block->members);
  }

 private:
  const SoftMaskPlan& plan_;
  const SoftMaskTile& tile_;
  SoftFrame frame_;
  TileRect box_{tile_.rect.x1, tile_.rect.y1, tile_.rect.x0, tile_.rect.y0};
  Background block_[kTileBlocks];
  std::size_t count_ = 0;
};

// Calls task(index into the image, index into the block's arrays, cell) for each background pixel.
template <class Task>
void ForBackground(const SoftMaskPlan& plan, const Background& pixels, const Task& task) {
  for (std::uint64_t rest = pixels.bits; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest), x = bit % kBlockSize, y = bit / kBlockSize;
    task(PixelIndex(plan, pixels.rect.x0 + x, pixels.rect.y0 + y), PixelOf(x, y), CellOf(x, y));
  }
}

// Which a cell that looked at `looked` of the tile's faces did not look at: a bound on their sum.
double CulledError(const SoftMaskPlan& plan, const SoftMaskTile& tile, std::size_t looked) {
  const std::size_t listed = tile.faces.size();
  return static_cast<double>(listed - looked) * std::exp(-DropZ(listed, plan.cull_error));
}

// Alpha of the background of a block that sees the members of `block`. Returns what was spent.
double ForwardBlock(const SoftMaskPlan& plan, const SoftMaskTile& tile, const Background& pixels,
                    SoftBlock* block, std::span<float> alpha) {
  SoftBlockAlpha out;
  std::fill_n(out.alpha, kBlockPixels, 1.0);
  block->cells = 0;
  ForBackground(plan, pixels, [&](std::size_t, std::size_t b, std::size_t cell) {
    out.alpha[b] = 0, block->cells |= 1u << cell;
  });
  block->stop = StopProduct(plan);
  HWY_DYNAMIC_DISPATCH(SoftMaskBlockTarget)(*block, &out);
  double culled[kCells], spent = 0;
  for (std::size_t s = 0; s < kCells; ++s) culled[s] = CulledError(plan, tile, out.looked[s]);
  ForBackground(plan, pixels, [&](std::size_t i, std::size_t b, std::size_t cell) {
    alpha[i] = static_cast<float>(out.alpha[b]);
    const double rest = (out.stopped >> cell & 1) != 0 ? 1 - out.alpha[b] : 0;
    spent = std::max(spent, tile.unlisted + culled[cell] + (rest > kUnseenProduct ? rest : 0));
  });
  return spent;
}

// Where no face is near.
double ClearBlock(const SoftMaskPlan& plan, const SoftMaskTile& tile, const Background& pixels,
                  std::span<float> alpha) {
  ForBackground(plan, pixels, [&](std::size_t i, std::size_t, std::size_t) { alpha[i] = 0; });
  return tile.unlisted + CulledError(plan, tile, 0);
}

// Sets the cells that have a gradient to hand on.
void CollectGradient(const SoftMaskPlan& plan, const Background& pixels,
                     std::span<const float> d_alpha, SoftBlockGradient* g, SoftBlock* block) {
  std::fill_n(g->d_alpha, kBlockPixels, 0.0f);
  block->cells = 0;
  ForBackground(plan, pixels, [&](std::size_t i, std::size_t b, std::size_t cell) {
    g->d_alpha[b] = d_alpha[i];
    block->cells |= static_cast<std::uint32_t>(d_alpha[i] != 0) << cell;
  });
}

}  // namespace

double SoftMaskForward(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                       std::span<float> alpha, SoftMaskScratch* scratch) {
  for (int y = tile.rect.y0; y < tile.rect.y1; ++y) {
    const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(plan.width);
    std::fill(alpha.data() + row + tile.rect.x0, alpha.data() + row + tile.rect.x1, 1.0f);
  }
  const TileBlocks blocks(plan, tile);
  if (!blocks.HasBackground()) return 0;
  SoftBlock block;
  blocks.SetUp(mesh, scratch, &block);
  double spent = 0;
  for (const Background& pixels : blocks.blocks()) {
    if (pixels.bits == 0) continue;
    blocks.Gather(pixels, scratch, &block);
    spent = std::max(spent, block.count == 0 ? ClearBlock(plan, tile, pixels, alpha)
                                             : ForwardBlock(plan, tile, pixels, &block, alpha));
  }
  return std::min(spent, 1.0);
}

void SoftMaskBackward(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                      std::span<const float> d_alpha, std::span<float> d_corners,
                      SoftMaskScratch* scratch) {
  std::fill(d_corners.begin(), d_corners.end(), 0.0f);
  const TileBlocks blocks(plan, tile);
  if (!blocks.HasBackground()) return;
  SoftBlock block;
  blocks.SetUp(mesh, scratch, &block);
  // The square: a face's gradient may be as large as the root of the product (docs/numerics.md).
  block.stop = plan.stop_error * plan.stop_error;
  for (const Background& pixels : blocks.blocks()) {
    if (pixels.bits == 0) continue;
    blocks.Gather(pixels, scratch, &block);
    if (block.count == 0) continue;
    SoftBlockGradient g;
    CollectGradient(plan, pixels, d_alpha, &g, &block);
    if (block.cells == 0) continue;
    scratch->products.resize(std::max(scratch->products.size(), block.count * kBlockPixels));
    g.products = scratch->products.data(), g.d_corners = d_corners.data();
    g.stride = tile.faces.size();
    HWY_DYNAMIC_DISPATCH(SoftMaskBlockBackwardTarget)(block, g);
  }
  const std::size_t half = d_corners.size() / 2;
  for (float& d : d_corners.first(half)) d *= static_cast<float>(plan.unit_x);
  for (float& d : d_corners.last(half)) d *= static_cast<float>(plan.unit_y);
}

}  // namespace tilegrad::raster
#endif
