// SPDX-License-Identifier: Apache-2.0
// Shared by the two passes of rasterize.h.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compat/nvdiffrast/barycentrics_ref.h"
#include "compat/nvdiffrast/rasterize.h"
#include "raster/conventions.h"

namespace tilegrad::compat::nvdiffrast {

template <class T>
Status CheckInput(const RasterizeInput<T>& input);

inline ClipCorners<double> CornersOf(const RasterizeInput<double>& input, std::size_t image,
                                     std::int32_t face) {
  ClipCorners<double> out;
  for (int k = 0; k < 3; ++k) {
    const double* p =
        input.positions.at(image, input.faces[3 * static_cast<std::size_t>(face) + k]);
    out.x[k] = p[0];
    out.y[k] = p[1];
    out.z[k] = p[2];
    out.w[k] = p[3];
  }
  return out;
}

// Caches the corners of the last face; adjacent pixels mostly show the same one.
class LastFace {
 public:
  LastFace(const RasterizeInput<double>& input, std::size_t image) : input_(input), image_(image) {}

  const ClipCorners<double>& operator()(std::int32_t face) {
    if (face != face_) {
      corners_ = CornersOf(input_, image_, face);
      face_ = face;
    }
    return corners_;
  }

 private:
  const RasterizeInput<double>& input_;
  std::size_t image_;
  std::int32_t face_ = raster::kNoFace;
  ClipCorners<double> corners_{};
};

}  // namespace tilegrad::compat::nvdiffrast
