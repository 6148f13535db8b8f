// SPDX-License-Identifier: Apache-2.0
#include "compat/kaolin/face_visibility.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compat/kaolin/face_visibility.cc"
#include <hwy/foreach_target.h>

#include "compat/kaolin/face_visibility-inl.h"

#if HWY_ONCE

namespace tilegrad::compat::kaolin {
namespace {

HWY_EXPORT(DrawProjectedFloat);
HWY_EXPORT(DrawProjectedDouble);

// Draws rows with `draw` and copies the visible faces.
template <class T, class Draw>
void DrawRows(const PixelCentresT<T>& pixels, std::size_t rows, FaceVisibilityScratchT<T>* scratch,
              const Draw& draw, std::int32_t* face_ids) {
  const std::size_t stride = pixels.width + PixelCentresT<T>::kPadding;
  scratch->nearest.assign(rows * stride, -std::numeric_limits<T>::infinity());
  scratch->face.assign(rows * stride, raster::kNoFace);
  draw();
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j < pixels.width; ++j) {
      face_ids[i * pixels.width + j] = static_cast<std::int32_t>(scratch->face[i * stride + j]);
    }
  }
}

}  // namespace

template <class T>
PixelCentresT<T>::PixelCentresT(int w, int h)
    : width(static_cast<std::size_t>(w)), height(static_cast<std::size_t>(h)) {
  for (int j = 0; j < w + static_cast<int>(kPadding); ++j) x.push_back(T(2 * j + 1 - w) / T(w));
  for (int i = 0; i < h; ++i) y.push_back(T(h - 2 * i - 1) / T(h));
}
template struct PixelCentresT<float>;
template struct PixelCentresT<double>;

void FaceVisibility(const ProjectedFacesT<float>& faces, const PixelCentresT<float>& pixels,
                    float eps, std::size_t row_begin, std::size_t row_end,
                    FaceVisibilityScratchT<float>* scratch, std::int32_t* face_ids) {
  const auto draw = [&] {
    HWY_DYNAMIC_DISPATCH(DrawProjectedFloat)(faces, pixels, eps, row_begin, row_end, scratch);
  };
  DrawRows(pixels, row_end - row_begin, scratch, draw, face_ids);
}

void FaceVisibility(const ProjectedFacesT<double>& faces, const PixelCentresT<double>& pixels,
                    double eps, std::size_t row_begin, std::size_t row_end,
                    FaceVisibilityScratchT<double>* scratch, std::int32_t* face_ids) {
  const auto draw = [&] {
    HWY_DYNAMIC_DISPATCH(DrawProjectedDouble)(faces, pixels, eps, row_begin, row_end, scratch);
  };
  DrawRows(pixels, row_end - row_begin, scratch, draw, face_ids);
}

}  // namespace tilegrad::compat::kaolin
#endif
