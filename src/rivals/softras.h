// SPDX-License-Identifier: Apache-2.0
// Silhouettes of SoftRas (S. Liu et al.: Soft Rasterizer, ICCV 2019) as in its published code:
// every face has a probability at every pixel near it, whether occluded or not,
//
//   D_j = sigmoid(d_j / sigma),   alpha = 1 - prod over faces (1 - D_j)
//
// with d_j the squared distance to the face's boundary, positive inside. What is as published, what
// is repaired, and where the code differs from the paper: docs/training.md.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "base/aligned.h"
#include "rivals/face_corners.h"

namespace tilegrad::rivals {

enum class SoftDistance {
  kHard,         // D = 1 in the face, edges included, 0 outside; no gradient
  kBarycentric,  // d = m^2 with the sign of m, the smallest barycentric weight
  kEuclidean,    // d = squared distance in image units
};
enum class SoftAlpha {
  kProduct,  // 1 - prod(1 - D)
  kSum,      // mean of D over all faces of the image
  kHard,     // 1 where some D > 0.5; no gradient
};

struct SoftRasOptions {
  SoftDistance distance = SoftDistance::kEuclidean;
  SoftAlpha alpha = SoftAlpha::kProduct;
  double sigma = 1e-4;                     // > 0; squared image units
  double dist_eps = 1e-10;                 // (0, 0.5): a pixel skips faces with smaller D
  double near_plane = 1, far_plane = 100;  // depths; faces beyond have no gradient of alpha
  // Repairs, off in the published form.
  bool exact_product = false;           // dalpha/dD without the floor of 1e-6 on 1 - D
  bool gradient_beyond_planes = false;  // gradient of alpha for faces beyond near and far, too

  // For squared distances.
  double Cutoff() const { return sigma * std::log(1 / dist_eps - 1); }
};

inline constexpr double kSoftFloor = 1e-6;             // published: floor of 1 - D in divisions
inline constexpr double kSmallestDoubledArea = 1e-10;  // smaller faces are skipped

// Rows [row_begin, row_end) of images of size x size.
struct RowRange {
  int begin, end;
};

// A face as read by the kernel.
struct SoftRasFace {
  float x[3], y[3], z[3];   // corners; edge k leads from corner k to corner k + 1
  float ex[3], ey[3];       // edges
  float inverse_length[3];  // of the squared edge; 0 for an edge without length
  float inverse_area;       // of the doubled area, with its sign
  float low_x, high_x;      // box, grown by the cut-off
  int column_begin, column_end, row_begin, row_end;  // pixels within reach; empty: skipped
  bool may_be_beyond;                                // some corner lies beyond near or far
};

// State of one image between its forward and its backward pass. `kept` is, per pixel, the product
// of 1 - D (kProduct), the sum of D (kSum), or 1 if a face counts (kHard).
struct SoftRasImage {
  AlignedVector<SoftRasFace> faces;
  AlignedVector<float> kept;  // [size][stride]
  AlignedVector<float> push;  // [size][stride] the pixel's factor of dL/dd; backward pass only
  int size = 0;
  std::size_t stride = 0;  // of rows: whole vectors may reach beyond the image
};

// Sets up an image of size x size with faces [F,3,3]. Skips faces that are not usable
// (face_corners.h) or have a doubled area below 1e-10.
void SetUpSoftRas(std::span<const float> corners, int size, const SoftRasOptions& options,
                  SoftRasImage* image);

// alpha: [size,size]; writes only `rows`. Each pixel processes faces in index order, so the bits do
// not depend on the division of rows.
void SoftRasForward(const SoftRasOptions& options, RowRange rows, SoftRasImage* image,
                    std::span<float> alpha);

// Call after SoftRasForward of all rows: reads d_alpha [size,size].
void SoftRasPrepareBackward(const SoftRasOptions& options, std::span<const float> d_alpha,
                            SoftRasImage* image);
// Then, for faces [begin, end): writes dL/d(corners) to d_corners [F,3,3]; that of z is 0.
void SoftRasBackward(const SoftRasOptions& options, const SoftRasImage& image, std::size_t begin,
                     std::size_t end, std::span<float> d_corners);

}  // namespace tilegrad::rivals
