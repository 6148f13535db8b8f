// SPDX-License-Identifier: Apache-2.0
// The part of the soft mask that decides which faces a block of pixels looks at. Scalar.
#pragma once

#include "raster/soft_mask.h"

namespace tilegrad::raster {

// A remaining product up to here changes alpha by less than half a unit in the last place of 1.
inline constexpr double kUnseenProduct = 0x1p-26;

// The product at which a pixel may stop.
double StopProduct(const SoftMaskPlan& plan);

// The tile's candidates, seen from its centre. `background`: the pixels that are computed are
// inside; faces too far from it are marked `far` and have no edges.
void SetUpFaces(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                const TileRect& background, AlignedVector<SoftFace>* faces);

// A block: the pixels its offsets count from, and those of them that are computed.
struct BlockPixels {
  TileRect rect, background;
};

// Fills scratch->members and `block` (all but `stop`) with the candidates that matter to the
// block's background. Returns a bound on the sum of A over the others, at any of these pixels.
double GatherBlock(const SoftMaskPlan& plan, const SoftMaskTile& tile, const BlockPixels& pixels,
                   SoftMaskScratch* scratch, SoftBlock* block);

}  // namespace tilegrad::raster
