// SPDX-License-Identifier: Apache-2.0
#include "raster/soft_mask.h"

#include <algorithm>

#include "raster/soft_mask_block.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/soft_mask.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "raster/soft_mask-inl.h"

#if HWY_ONCE

namespace tilegrad::raster {
HWY_EXPORT(SoftMaskBlockTarget);
HWY_EXPORT(SoftMaskBlockBackwardTarget);

namespace {

// Calls task(block) for each block of the tile.
template <class Task>
void ForBlocks(const TileRect& tile, const Task& task) {
  for (int y = tile.y0; y < tile.y1; y += kBlockSize) {
    for (int x = tile.x0; x < tile.x1; x += kBlockSize) {
      task(TileRect{x, y, std::min(x + kBlockSize, tile.x1), std::min(y + kBlockSize, tile.y1)});
    }
  }
}

std::size_t PixelIndex(const SoftMaskPlan& plan, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(plan.width) +
         static_cast<std::size_t>(x);
}

// Calls task(index into the image, index into the block) for each background pixel of the block.
template <class Task>
void ForBackground(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& block,
                   const Task& task) {
  for (int y = block.y0; y < block.y1; ++y) {
    for (int x = block.x0; x < block.x1; ++x) {
      const std::size_t image = PixelIndex(plan, x, y);
      if (tile.face_ids[image] >= 0) continue;
      task(image, static_cast<std::size_t>(y - block.y0) * kBlockSize +
                      static_cast<std::size_t>(x - block.x0));
    }
  }
}

// The smallest rectangle with all background pixels of `rect`; x1 <= x0 if there is none.
TileRect BackgroundBox(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& rect) {
  TileRect box{rect.x1, rect.y1, rect.x0, rect.y0};
  for (int y = rect.y0; y < rect.y1; ++y) {
    for (int x = rect.x0; x < rect.x1; ++x) {
      if (tile.face_ids[PixelIndex(plan, x, y)] >= 0) continue;
      box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1), y + 1};
    }
  }
  return box;
}

// `rect` is the block, `box` its background.
double ForwardBlock(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& rect,
                    const TileRect& box, std::span<float> alpha, SoftMaskScratch* scratch) {
  SoftBlockAlpha out;
  std::fill_n(out.alpha, kBlockPixels, 1.0);
  ForBackground(plan, tile, rect, [&](std::size_t, std::size_t b) { out.alpha[b] = 0; });
  SoftBlock block;
  const double culled = GatherBlock(plan, tile, {rect, box}, scratch, &block);
  block.stop = StopProduct(plan);
  HWY_DYNAMIC_DISPATCH(SoftMaskBlockTarget)(block, &out);
  double spent = 0;
  ForBackground(plan, tile, rect, [&](std::size_t i, std::size_t b) {
    alpha[i] = static_cast<float>(out.alpha[b]);
    const double rest = out.stopped[b / (2 * kBlockSize)] ? 1 - out.alpha[b] : 0;
    spent = std::max(spent, tile.unlisted + culled + (rest > kUnseenProduct ? rest : 0));
  });
  return spent;
}

// True if a pixel of the block has a gradient to hand on.
bool CollectGradient(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& rect,
                     std::span<const float> d_alpha, SoftBlockGradient* g) {
  std::fill_n(g->d_alpha, kBlockPixels, 0.0f);
  bool any = false;
  ForBackground(plan, tile, rect, [&](std::size_t i, std::size_t b) {
    g->d_alpha[b] = d_alpha[i];
    any = any || d_alpha[i] != 0;
  });
  return any;
}

}  // namespace

double SoftMaskForward(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                       std::span<float> alpha, SoftMaskScratch* scratch) {
  for (int y = tile.rect.y0; y < tile.rect.y1; ++y) {
    const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(plan.width);
    std::fill(alpha.data() + row + tile.rect.x0, alpha.data() + row + tile.rect.x1, 1.0f);
  }
  const TileRect background = BackgroundBox(plan, tile, tile.rect);
  if (background.x1 <= background.x0) return 0;
  SetUpFaces(mesh, plan, tile, background, &scratch->faces);
  double spent = 0;
  ForBlocks(tile.rect, [&](const TileRect& rect) {
    const TileRect box = BackgroundBox(plan, tile, rect);
    if (box.x1 <= box.x0) return;
    spent = std::max(spent, ForwardBlock(plan, tile, rect, box, alpha, scratch));
  });
  return std::min(spent, 1.0);
}

void SoftMaskBackward(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                      std::span<const float> d_alpha, std::span<float> d_corners,
                      SoftMaskScratch* scratch) {
  std::fill(d_corners.begin(), d_corners.end(), 0.0f);
  bool set_up = false;
  ForBlocks(tile.rect, [&](const TileRect& rect) {
    SoftBlockGradient g;
    if (!CollectGradient(plan, tile, rect, d_alpha, &g)) return;
    if (!set_up) {
      SetUpFaces(mesh, plan, tile, BackgroundBox(plan, tile, tile.rect), &scratch->faces);
    }
    set_up = true;
    const TileRect box = BackgroundBox(plan, tile, rect);
    SoftBlock block;
    GatherBlock(plan, tile, {rect, box}, scratch, &block);
    // The square: a face's gradient may be as large as the root of the product (docs/numerics.md).
    block.stop = plan.stop_error * plan.stop_error;
    scratch->products.resize(std::max(scratch->products.size(), block.count * kBlockPixels));
    g.products = scratch->products.data(), g.d_corners = d_corners.data();
    g.stride = tile.faces.size();
    HWY_DYNAMIC_DISPATCH(SoftMaskBlockBackwardTarget)(block, g);
  });
  const std::size_t half = d_corners.size() / 2;
  for (float& d : d_corners.first(half)) d *= static_cast<float>(plan.unit_x);
  for (float& d : d_corners.last(half)) d *= static_cast<float>(plan.unit_y);
}

}  // namespace tilegrad::raster
#endif
