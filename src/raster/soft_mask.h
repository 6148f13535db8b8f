// SPDX-License-Identifier: Apache-2.0
// The soft mask (paper, equations 5 and 6): alpha of background pixels,
//
//     alpha = 1 - prod_j (1 - A_j),    A_j = exp(-z_j),    z_j = d_j^2 / delta,
//
// over all faces that take part (drawn, culled, degenerate), where d_j is the distance of the pixel
// centre to the boundary of face j in NDC. Within a stated error of *all* faces, however many there
// are and in whatever order: docs/numerics.md has the proof and says what each name here means.
//
// Per image: PlanSoftMask, then BinSoftFaces(mesh, grid, plan.margin_x, plan.margin_y). Per tile,
// in any order and by any worker: SoftMaskForward, SoftMaskBackward.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "raster/bin.h"
#include "raster/screen_mesh.h"
#include "raster/soft_mask_setup.h"

namespace tilegrad::raster {

struct SoftMaskOptions {
  int width = 0, height = 0;      // pixels, of the image
  double delta = 1.0 / 7000;      // equation 5; > 0
  double max_alpha_error = 1e-6;  // E in [0, 1]; 0 drops a face only where A < 2^-125
  std::size_t faces = 0;          // of the mesh that take part: not kFaceNotInSoftMask
};

// What is decided once per image. Lengths in kernel units: NDC / sqrt(delta), so that z = d^2.
struct SoftMaskPlan {
  int width = 0, height = 0;
  double unit_x = 0, unit_y = 0;                         // kernel units per pixel
  double bin_error = 0, cull_error = 0, stop_error = 0;  // the shares of E; they sum to E
  double bin_z = 0;                  // A of a face that a tile does not list is <= exp(-bin_z)
  float margin_x = 0, margin_y = 0;  // pixels, for BinSoftFaces
  std::size_t faces = 0;
};

SoftMaskPlan PlanSoftMask(const SoftMaskOptions& options);

// The number of faces of `mesh` that take part.
std::size_t CountSoftFaces(const ScreenMesh& mesh);

// One tile of one image. Images are [H,W]; spans hold whole images.
struct SoftMaskTile {
  TileRect rect;
  std::span<const std::int32_t> faces;  // candidates: indices into the mesh, of faces taking part
  // Bound on the sum of A over all faces that take part and are not listed, at any pixel of the
  // tile. BinnedError(plan, faces.size()) for lists of BinSoftFaces; other ways to make lists (a
  // hierarchy) book their own.
  double unlisted = 0;
  std::span<const std::int32_t> face_ids;  // < 0 is background; only those are computed
};
double BinnedError(const SoftMaskPlan& plan, std::size_t listed);

// Memory of one worker. Grows to the longest list seen, then nothing is allocated.
struct SoftMaskScratch {
  SoftFaces faces;                       // those of the tile's candidates that are not far
  AlignedVector<SoftBlockFace> members;  // those that a block keeps; never shrinks
  AlignedVector<float> products;         // [members][kBlockPixels] product before each member
};

// Writes alpha of the tile's pixels: 1 where face_ids >= 0. Returns what was spent: no pixel is
// farther than this from equation 6 over all faces, rounding aside (docs/numerics.md, "Rounding").
// At most E if tile.unlisted <= plan.bin_error. 0 where no pixel of the tile is background.
double SoftMaskForward(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                       std::span<float> alpha, SoftMaskScratch* scratch);

// dL/d(corners) of the tile's candidates, per pixel: with F = tile.faces.size(),
// d_corners[k * F + n] <- d_x and d_corners[(3 + k) * F + n] <- d_y of corner k of tile.faces[n].
// Overwritten; the caller merges tiles in a fixed order.
// d_alpha as alpha; foreground pixels have no gradient. The nearest feature of each face is held
// fixed (envelope theorem); on the boundary itself, where A has a kink-free maximum, it is 0.
void SoftMaskBackward(const ScreenMesh& mesh, const SoftMaskPlan& plan, const SoftMaskTile& tile,
                      std::span<const float> d_alpha, std::span<float> d_corners,
                      SoftMaskScratch* scratch);

}  // namespace tilegrad::raster
