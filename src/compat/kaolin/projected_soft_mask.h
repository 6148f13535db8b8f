// SPDX-License-Identifier: Apache-2.0
// The soft mask (paper, equations 5 and 6) of projected faces: all of them take part, valid or not.
// Same bits for any number of workers.
#pragma once

#include <cstdint>
#include <span>

#include "base/parallel.h"
#include "compat/projected_batch.h"
#include "tilegrad/options.h"

namespace tilegrad::compat::kaolin {

struct ProjectedMaskOptions {
  ImageSize size;             // pixels, 1..16384
  double delta = 1.0 / 7000;  // equation 5, NDC^2; > 0
  AlphaRule rule = AlphaRule::kAllFaces;
  double max_alpha_error = 1e-6;  // with kAllFaces, in [0, 1]; 0 drops nothing
  double paper_box = 0.02;        // with kPaper, as RenderOptions
  int paper_faces = 30;
  double paper_eps = 1e-13;  // with kPaper: NDC^2, added to the squared length of an edge; >= 0
};

// alpha [N,H,W] <- 1 where face_ids [N,H,W] are >= 0, the soft mask elsewhere. Returns what was
// spent: with kAllFaces no pixel is farther than this from equation 6 over all faces, rounding
// aside; it is infinite with kPaper. float runs the vector kernels of raster/soft_mask/soft_mask.h,
// double scalar code over the faces near a tile.
template <class T>
Result<double> ProjectedSoftMask(const ProjectedBatchT<T>& batch,
                                 const ProjectedMaskOptions& options,
                                 std::span<const std::int32_t> face_ids, const Workers& workers,
                                 std::span<T> alpha);

template <class T>
struct ProjectedMaskAdjoint {
  std::span<const std::int32_t> face_ids;  // [N,H,W]
  std::span<const T> alpha;                // [N,H,W] as ProjectedSoftMask wrote it
  std::span<const T> d_alpha;              // [N,H,W]; foreground pixels have no gradient
  std::span<T> d_xy;                       // [N,F,3,2], overwritten
};
template <class T>
Status ProjectedSoftMaskBackward(const ProjectedBatchT<T>& batch,
                                 const ProjectedMaskOptions& options, const Workers& workers,
                                 const ProjectedMaskAdjoint<T>& adjoint);

}  // namespace tilegrad::compat::kaolin
