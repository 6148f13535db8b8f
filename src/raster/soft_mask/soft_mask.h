// SPDX-License-Identifier: Apache-2.0
// The soft mask (paper, equations 5 and 6): alpha of background pixels,
//
//     alpha = 1 - prod_j (1 - A_j),    A_j = exp(-d_j^2 / delta),
//
// over all faces that take part (drawn, culled, degenerate), where d_j is the distance of the pixel
// centre to the boundary of face j in NDC. Within a stated error of *all* faces, however many there
// are and in whatever order: docs/numerics.md has the proof and says what each name here means.
//
// Per image: BuildSoftTree, then PlanSoftMask. Per region, in any order and by any worker:
// SoftMaskForward, SoftMaskBackward. The bits do not depend on how an image is cut into regions.
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
  double max_alpha_error = 1e-6;  // E in [0, 1]; 0 drops a face only where A <= 2^-126
  std::size_t faces = 0;          // that take part: SoftTree::faces
};

// Decided once per image. Lengths in kernel units, NDC times sqrt(log2(e) / delta), so that A =
// 2^-z with z = d^2.
struct SoftMaskPlan {
  int width = 0, height = 0;
  double unit_x = 0, unit_y = 0;  // kernel units per pixel
  // Shares of E: for the nodes and the faces that are dropped, and the product at which a pixel
  // stops, whatever was dropped before.
  double node_error = 0, face_error = 0, stop_error = 0;
  double group_z = 0;          // squared distance at which a tile drops a group of the tree
  double group_influence = 0;  // A there
};

SoftMaskPlan PlanSoftMask(const SoftMaskOptions& options);

// Whole tiles of one image, preferably those of a bin: groups far from all of them are found once.
// Images are [H,W]; spans hold whole images.
struct SoftMaskRegion {
  PixelRect rect;
  std::span<const std::int32_t> face_ids;  // < 0 is background; only those are computed
};

struct SoftMaskImages {
  std::span<float> alpha;  // [H,W] 1 where face_ids >= 0
  // May be empty. Input of the backward pass, as many numbers as alpha but stored block by block of
  // up to 8 x 8 pixels, in rows of blocks. Written only where a block has background pixels with
  // alpha above E / 4: the product over all faces, 1 - alpha, to relative precision where that is
  // enough; 0 where no gradient passes; kUnknownTransmittance where backward must multiply again
  // (docs/numerics.md, "Gradients").
  std::span<float> transmittance = {};
};
inline constexpr float kUnknownTransmittance = -1;

// Writes the region's pixels. Returns the error spent: no pixel's alpha is farther than this from
// equation 6 over all faces, rounding aside (docs/numerics.md, "Rounding"). At most E. 0 where no
// pixel is background.
double SoftMaskForward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskRegion& region,
                       const SoftMaskImages& images, SoftMaskScratch* scratch);

struct SoftMaskAdjoint {
  std::span<const float> alpha;          // as SoftMaskForward wrote it
  std::span<const float> transmittance;  // likewise; empty: from alpha, for more work
  std::span<const float> d_alpha;        // foreground pixels have no gradient
};

// Appends dL/d(corners) of the faces that the region's pixels see to `out`, in an order that
// depends on the scene only; a face may come more than once. The nearest feature of each face is
// held fixed (envelope theorem); on the boundary itself, where A has a kink-free maximum, the
// gradient is 0.
void SoftMaskBackward(const SoftTree& tree, const SoftMaskPlan& plan, const SoftMaskRegion& region,
                      const SoftMaskAdjoint& adjoint, AlignedVector<SoftFaceGradient>* out,
                      SoftMaskScratch* scratch);

}  // namespace tilegrad::raster
