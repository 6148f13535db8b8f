// SPDX-License-Identifier: Apache-2.0
// The visible one of an image's projected faces at each pixel (projected_batch.h has the rule).
// Discrete: no gradient.
//
// A face covers the pixel centres p with low <= p < high along both axes of its box where every
// nonzero W_k has the sign of S, and S is finite and not 0. Of the faces that cover a pixel, the
// one with the largest z is visible; at equal z, the first. z = sum w_k z_k, clamped to the range
// of the z_k and summed over the corners in a canonical order (OrderedFace), has the same bits
//
//   * for the same three corners, whatever their order and winding;
//   * for all faces whose corners have one z: it is that z.
//
// Other coplanar faces are equal only up to rounding, which then decides.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>

#include "base/aligned.h"
#include "compat/projected_batch.h"

namespace tilegrad::compat::kaolin {

// Centres of the pixels of an image in NDC: x_j = (2j + 1 - W) / W, y_i = (H - 2i - 1) / H.
template <class T>
struct PixelCentresT {
  static constexpr std::size_t kPadding = 16;  // columns for whole vectors
  std::size_t width = 0, height = 0;
  AlignedVector<T> x;  // [W + kPadding]
  AlignedVector<T> y;  // [H], descending

  PixelCentresT(int w, int h);
};

// The corners of a face sorted by x, then y, then z, and the range of z.
template <class T>
struct OrderedFace {
  T xy[6], z[3], low, high;

  OrderedFace(const ProjectedFacesT<T>& faces, std::size_t face) {
    std::array<std::array<T, 3>, 3> corners;
    const T* v = faces.corners(face);
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = {v[2 * k], v[2 * k + 1], faces.z[3 * face + k]};
    }
    std::sort(corners.begin(), corners.end());
    for (std::size_t k = 0; k < 3; ++k) {
      xy[2 * k] = corners[k][0];
      xy[2 * k + 1] = corners[k][1];
      z[k] = corners[k][2];
    }
    std::tie(low, high) = std::minmax({z[0], z[1], z[2]});
  }
};

// Scratch of one worker.
template <class T>
struct FaceVisibilityScratchT {
  using Id = std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>;
  AlignedVector<T> nearest;  // [rows][W + kPadding]
  AlignedVector<Id> face;
};

// Rows [row_begin, row_end) of the image: face_ids [rows][W] <- index of the visible face, or
// raster::kNoFace. `eps` >= 0, NDC^2. The same bits as FaceVisibilityRef on every instruction set.
void FaceVisibility(const ProjectedFacesT<float>& faces, const PixelCentresT<float>& pixels,
                    float eps, std::size_t row_begin, std::size_t row_end,
                    FaceVisibilityScratchT<float>* scratch, std::int32_t* face_ids);
void FaceVisibility(const ProjectedFacesT<double>& faces, const PixelCentresT<double>& pixels,
                    double eps, std::size_t row_begin, std::size_t row_end,
                    FaceVisibilityScratchT<double>* scratch, std::int32_t* face_ids);

}  // namespace tilegrad::compat::kaolin
