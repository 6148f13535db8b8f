// SPDX-License-Identifier: Apache-2.0
// Scalar reference of face_visibility.h: tests every face at every pixel.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "compat/kaolin/face_visibility.h"
#include "raster/conventions.h"

namespace tilegrad::compat::kaolin {

// Whether corners [3,2] cover the centre (px, py).
template <class T>
bool CoversCentre(const T* v, const T& px, const T& py) {
  const auto [left, right] = std::minmax({v[0], v[2], v[4]});
  const auto [bottom, top] = std::minmax({v[1], v[3], v[5]});
  if (!(px >= left && px < right && py >= bottom && py < top)) return false;
  const auto w = CornerAreas(v, px, py);
  const T area = (w[0] + w[1]) + w[2];
  if (!std::isfinite(area) || area == 0) return false;
  return (w[0] >= 0 && w[1] >= 0 && w[2] >= 0) || (w[0] <= 0 && w[1] <= 0 && w[2] <= 0);
}

template <class T>
std::int32_t FaceSeenRef(const ProjectedFacesT<T>& faces, const T& px, const T& py, const T& eps) {
  T nearest = -std::numeric_limits<T>::infinity();
  std::int32_t best = raster::kNoFace;
  for (std::size_t f = 0; f < faces.count(); ++f) {
    const OrderedFace<T> face(faces, f);
    if (!faces.is_valid(f) || !CoversCentre(face.xy, px, py)) continue;
    const auto w = ScreenWeights(face.xy, px, py, eps);
    const T sum = (w[0] * face.z[0] + w[1] * face.z[1]) + w[2] * face.z[2];
    const T z = std::min(std::max(sum, face.low), face.high);
    if (z > nearest) {
      nearest = z;
      best = static_cast<std::int32_t>(f);
    }
  }
  return best;
}

// All rows.
template <class T>
std::vector<std::int32_t> FaceVisibilityRef(const ProjectedFacesT<T>& faces,
                                            const PixelCentresT<T>& pixels, const T& eps) {
  std::vector<std::int32_t> ids;
  for (const T& y : pixels.y) {
    for (std::size_t j = 0; j < pixels.width; ++j) {
      ids.push_back(FaceSeenRef(faces, pixels.x[j], y, eps));
    }
  }
  return ids;
}

}  // namespace tilegrad::compat::kaolin
