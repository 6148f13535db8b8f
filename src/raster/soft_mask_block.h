// SPDX-License-Identifier: Apache-2.0
// The scalar part of the soft mask's culling: what a tile, a block and a cell may drop.
#pragma once

#include "raster/soft_mask.h"

namespace tilegrad::raster {

// A remaining product up to here changes alpha by less than half a unit in the last place of 1.
inline constexpr double kUnseenProduct = 0x1p-26;

// The product at which a pixel may stop.
double StopProduct(const SoftMaskPlan& plan);

// From pixels to kernel units, counted from the centre of a tile.
struct SoftFrame {
  double x, y;            // the centre, pixels
  double unit_x, unit_y;  // kernel units per pixel
};
SoftFrame FrameOf(const SoftMaskPlan& plan, const TileRect& tile);

struct SoftPoint {
  double x, y;
};
SoftPoint ToUnits(const SoftFrame& frame, double x, double y);

// z from which on `n` faces have A <= share / n each, and together no more than `share`.
double DropZ(std::size_t n, double share);

// What is far from the centres of `pixels`, if `z` is what they may drop.
SoftBox BoxOf(const SoftFrame& frame, const TileRect& pixels, double z);

// Sets what all blocks of a tile have in common: where pixels and cells lie, and what a cell may
// drop.
void SetUpBlock(const SoftFrame& frame, double z, SoftBlock* block);

}  // namespace tilegrad::raster
