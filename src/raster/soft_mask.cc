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

// Calls task(index into the image, index into the block) for each background pixel of the block.
template <class Task>
void ForBackground(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& block,
                   const Task& task) {
  for (int y = block.y0; y < block.y1; ++y) {
    for (int x = block.x0; x < block.x1; ++x) {
      const std::size_t image = static_cast<std::size_t>(y) * static_cast<std::size_t>(plan.width) +
                                static_cast<std::size_t>(x);
      if (tile.face_ids[image] >= 0) continue;
      task(image, static_cast<std::size_t>(y - block.y0) * kBlockSize +
                      static_cast<std::size_t>(x - block.x0));
    }
  }
}

double ForwardBlock(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& rect,
                    std::span<float> alpha, SoftMaskScratch* scratch) {
  SoftBlockAlpha out;
  std::fill_n(out.alpha, kBlockPixels, 1.0);
  ForBackground(plan, tile, rect, [&](std::size_t, std::size_t b) { out.alpha[b] = 0; });
  SoftBlock block;
  const double culled = GatherBlock(plan, tile, rect, scratch, &block);
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

bool AnyBackground(const SoftMaskPlan& plan, const SoftMaskTile& tile, const TileRect& rect) {
  bool any = false;
  ForBackground(plan, tile, rect, [&](std::size_t, std::size_t) { any = true; });
  return any;
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
  if (!AnyBackground(plan, tile, tile.rect)) return 0;
  SetUpFaces(mesh, plan, tile, &scratch->faces);
  double spent = 0;
  ForBlocks(tile.rect, [&](const TileRect& rect) {
    if (!AnyBackground(plan, tile, rect)) return;
    spent = std::max(spent, ForwardBlock(plan, tile, rect, alpha, scratch));
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
    if (!set_up) SetUpFaces(mesh, plan, tile, &scratch->faces);
    set_up = true;
    SoftBlock block;
    GatherBlock(plan, tile, rect, scratch, &block);
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
