// SPDX-License-Identifier: Apache-2.0
// The soft mask (paper, equations 5 and 6): alpha of background pixels,
//
//     alpha = 1 - prod_j (1 - A_j),    A_j = exp(-d_j^2 / delta),
//
// over all faces that take part (drawn, culled, degenerate), where d_j is the distance of the pixel
// centre to the boundary of face j in NDC. Within a stated error of *all* faces, whatever their
// number and order: docs/numerics.md has the proof and defines each name used here.
//
// Per image: BuildSoftTree, then PlanSoftMask. Per region, in any order and by any worker:
// SoftMaskForward, SoftMaskBackward. The bits do not depend on the division of an image into
// regions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "raster/bin.h"
#include "raster/soft_mask/setup.h"
#include "raster/soft_mask/tree.h"

namespace tilegrad::raster {

struct SoftMaskOptions {
  int width = 0, height = 0;      // pixels, of the image
  double delta = 1.0 / 7000;      // equation 5; > 0
  double max_alpha_error = 1e-6;  // E in [0, 1]; 0 drops a face only if A <= 2^-126
  std::size_t faces = 0;          // that take part: SoftTree::faces
};

// Computed once per image. Lengths in kernel units, NDC times sqrt(log2(e) / delta), so that A =
// 2^-z with z = d^2.
struct SoftMaskPlan {
  int width = 0, height = 0;
  double unit_x = 0, unit_y = 0;  // kernel units per pixel
  // Shares of E: for the dropped nodes and faces, and the product at which a pixel stops, whatever
  // was dropped before.
  double node_error = 0, face_error = 0, stop_error = 0;
  double group_z = 0;          // squared distance at which a tile drops a group of the tree
  double group_influence = 0;  // A there
};

SoftMaskPlan PlanSoftMask(const SoftMaskOptions& options);

// Whole tiles of one image, preferably those of a bin, which then finds distant groups once for
// all. Images are [H,W]; spans hold whole images.
struct SoftMaskRegion {
  PixelRect rect;
  std::span<const std::int32_t> face_ids;  // < 0 is background; computes only background
};

struct SoftMaskImages {
  std::span<float> alpha;  // [H,W] 1 where face_ids >= 0
  // May be empty. Input of the backward pass, with as many numbers as alpha but stored block by
  // block of up to 8 x 8 pixels, in rows of blocks. Written only for blocks with background pixels
  // whose alpha exceeds E / 4: the product over all faces, 1 - alpha, to relative precision if that
  // suffices; 0 if no gradient passes; kUnknownTransmittance if the backward pass must multiply
  // again (docs/numerics.md, "Gradients").
  std::span<float> transmittance = {};
};
inline constexpr float kUnknownTransmittance = -1;

// Writes the region's pixels. Returns the error spent: no pixel's alpha differs by more from
// equation 6 over all faces, rounding aside (docs/numerics.md, "Rounding"). At most E; 0 if no
// pixel is background.
double SoftMaskForward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskRegion& region,
                       const SoftMaskImages& images, SoftMaskScratch* scratch);

struct SoftMaskAdjoint {
  std::span<const float> alpha;          // as written by SoftMaskForward
  std::span<const float> transmittance;  // likewise; empty: recomputed from alpha, at a cost
  std::span<const float> d_alpha;        // foreground pixels have no gradient
};

// Appends dL/d(corners) of the faces that the region's pixels see to `out`, in an order that
// depends on the scene only; a face may occur more than once. Holds the nearest feature of each
// face fixed (envelope theorem); on the boundary itself, where A has a kink-free maximum, the
// gradient is 0.
void SoftMaskBackward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskRegion& region,
                      const SoftMaskAdjoint& adjoint, AlignedVector<SoftFaceGradient>* out,
                      SoftMaskScratch* scratch);

}  // namespace tilegrad::raster
