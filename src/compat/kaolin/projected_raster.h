// SPDX-License-Identifier: Apache-2.0
// Rasterizes projected faces to images of interpolated features, with gradients (paper, equations 1
// to 4). Same bits for any number of workers.
//
// With b_k = W_k / S and r = S / (S + sign(S) eps), feature c of a pixel is I_c = r sum_k f_kc b_k.
// b_k is linear in the position and db_k/dv_m = -b_m grad b_k, so the gradient of the corners
// follows from that of the features, D_kc = dL/df_kc = sum over pixels of w_k dL/dI_c, alone:
//
//     dL/dv_m = -sum_c D_mc sum_k f_kc grad b_k + (sum_kc f_kc D_kc) / r dr/dS dS/dv_m
//
// The last term is due to eps: it is exact here; other implementations omit it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/parallel.h"
#include "compat/projected_batch.h"
#include "tilegrad/options.h"

namespace tilegrad::compat::kaolin {

struct ProjectedRasterOptions {
  ImageSize size;      // pixels, 1..16384
  double eps = 1e-14;  // NDC^2, >= 0: in the denominator of weights
};

// The visible face of each pixel: face_ids [N,H,W], -1 is background; and, if `channels` > 0, its
// features [N,F,3,C] interpolated there, [N,H,W,C], 0 at background pixels. Errors name the array,
// the index and the expected value.
template <class T>
Status RasterizeProjected(const ProjectedBatchT<T>& batch, const ProjectedRasterOptions& options,
                          std::span<const T> features, std::size_t channels, const Workers& workers,
                          std::span<std::int32_t> face_ids, std::span<T> image);

// dL/d(image) in, gradients out: overwritten, or not computed if empty. Visibility is held fixed,
// and z has no gradient. A gradient that overflows T is an error.
template <class T>
struct ProjectedRasterAdjoint {
  std::span<const std::int32_t> face_ids;  // [N,H,W]
  std::span<const T> d_image;              // [N,H,W,C]
  std::span<T> d_xy;                       // [N,F,3,2]
  std::span<T> d_features;                 // [N,F,3,C]
};
template <class T>
Status RasterizeProjectedBackward(const ProjectedBatchT<T>& batch,
                                  const ProjectedRasterOptions& options,
                                  std::span<const T> features, std::size_t channels,
                                  const Workers& workers, const ProjectedRasterAdjoint<T>& adjoint);

// The soft mask (paper, equations 5 and 6) over all projected faces, valid or not. Same bits for
// any number of workers.

struct ProjectedMaskOptions {
  ImageSize size;             // pixels, 1..16384
  double delta = 1.0 / 7000;  // equation 5, NDC^2; > 0
  AlphaRule rule = AlphaRule::kAllFaces;
  double max_alpha_error = 1e-6;  // with kAllFaces, in [0, 1]; 0 drops no face
  double paper_box = 0.02;        // with kPaper, as in RenderOptions
  int paper_faces = 30;
  double paper_eps = 1e-13;  // with kPaper: NDC^2, added to the squared length of an edge; >= 0
};

// alpha [N,H,W] <- 1 where face_ids [N,H,W] are >= 0, the soft mask elsewhere. Returns the error
// spent: with kAllFaces no pixel differs by more from equation 6 over all faces, rounding aside;
// infinite with kPaper. float runs the vector kernels of raster/soft_mask/soft_mask.h, double
// scalar code over the faces near a tile.
template <class T>
Result<double> ProjectedSoftMask(const ProjectedBatchT<T>& batch,
                                 const ProjectedMaskOptions& options,
                                 std::span<const std::int32_t> face_ids, const Workers& workers,
                                 std::span<T> alpha);

template <class T>
struct ProjectedMaskAdjoint {
  std::span<const std::int32_t> face_ids;  // [N,H,W]
  std::span<const T> alpha;                // [N,H,W] as written by ProjectedSoftMask
  std::span<const T> d_alpha;              // [N,H,W]; foreground pixels have no gradient
  std::span<T> d_xy;                       // [N,F,3,2], overwritten
};
template <class T>
Status ProjectedSoftMaskBackward(const ProjectedBatchT<T>& batch,
                                 const ProjectedMaskOptions& options, const Workers& workers,
                                 const ProjectedMaskAdjoint<T>& adjoint);

}  // namespace tilegrad::compat::kaolin
