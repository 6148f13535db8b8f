// SPDX-License-Identifier: Apache-2.0
// Which of an image's projected faces is seen in each pixel (projected_faces.h has the rule).
// Discrete: no gradient.
//
// A face covers the pixel centres p with low <= p < high along both axes of its box where no W_k
// has another sign than S, and S is finite and not 0. Of the faces that cover a pixel, the one with
// the largest z = sum w_k z_k is seen; of several, the first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "base/aligned.h"
#include "compat/projected_faces.h"

namespace tilegrad::compat::kaolin {

// Centres of the pixels of an image in NDC: x_j = (2j + 1 - W) / W, y_i = (H - 2i - 1) / H.
template <class T>
struct PixelCentresT {
  static constexpr std::size_t kPadding = 16;  // columns for whole vectors
  std::size_t width = 0, height = 0;
  AlignedVector<T> x;  // [W + kPadding]
  AlignedVector<T> y;  // [H], falling

  PixelCentresT(int w, int h);
};

// Scratch of one worker.
template <class T>
struct FaceVisibilityScratchT {
  using Id = std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>;
  AlignedVector<T> nearest;  // [rows][W + kPadding]
  AlignedVector<Id> face;
};

// Rows [row_begin, row_end) of the image: face_ids [rows][W] <- index of the face that is seen, or
// raster::kNoFace. `eps` >= 0, NDC^2. The same bits as FaceVisibilityRef on every instruction set.
void FaceVisibility(const ProjectedFacesT<float>& faces, const PixelCentresT<float>& pixels,
                    float eps, std::size_t row_begin, std::size_t row_end,
                    FaceVisibilityScratchT<float>* scratch, std::int32_t* face_ids);
void FaceVisibility(const ProjectedFacesT<double>& faces, const PixelCentresT<double>& pixels,
                    double eps, std::size_t row_begin, std::size_t row_end,
                    FaceVisibilityScratchT<double>* scratch, std::int32_t* face_ids);

}  // namespace tilegrad::compat::kaolin
