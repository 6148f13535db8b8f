// SPDX-License-Identifier: Apache-2.0
// Which face is seen in each pixel of a tile (conventions.h, rules 3 and 4). Discrete: no gradient.
#pragma once

#include <cstdint>
#include <span>

#include "raster/bin.h"
#include "raster/drawn_faces.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Pixel arrays of one bin, rows of kBinSize; columns beyond the image are background, rows beyond
// hold anything.
struct VisibilityBin {
  // Index into the ScreenMesh, kNoFace: background.
  alignas(128) std::int32_t face[kBinSize * kBinSize];
  alignas(128) float inverse_depth[kBinSize * kBinSize];  // 1/depth; 0 at background
};

// The drawn faces of a mesh that may cover a bin.
struct BinDrawList {
  std::span<const DrawnFace> faces;       // of the image
  std::span<const std::int32_t> indices;  // into them, ascending
};

// Draws a bin: `rect` of BinGrid. The result does not depend on the instruction set: the same bits
// as VisibilityRef<float> everywhere.
void ComputeVisibility(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
                       VisibilityBin* out);

// The same for the faces behind `behind` [kBinSize][kBinSize]: a pixel shows the nearest face whose
// 1/depth is less than its entry. Infinity admits every face, 0 none; the 1/depth of one layer
// yields the next (depth peeling). Of several faces at one depth only one is ever shown.
void PeelVisibility(const ScreenMesh& mesh, const BinDrawList& list, const PixelRect& rect,
                    const float* behind, VisibilityBin* out);

}  // namespace tilegrad::raster
