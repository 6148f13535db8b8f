// SPDX-License-Identifier: Apache-2.0
// What nvdiffrast's operations are given: faces over vertices, and an image that names a face for
// every pixel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "tilegrad/status.h"

namespace tilegrad::compat::nvdiffrast {

// Rows of numbers at vertices: positions in clip space (4), or attributes.
template <class T>
struct VertexRows {
  std::span<const T> values;  // [N,V,C], or [V,C] if shared by all images
  std::size_t vertices = 0, channels = 0;
  bool shared = false;

  // Where a vertex stands among all rows.
  std::size_t row(std::size_t image, std::int32_t vertex) const {
    return (shared ? 0 : image * vertices) + static_cast<std::size_t>(vertex);
  }
  const T* at(std::size_t image, std::int32_t vertex) const {
    return values.data() + row(image, vertex) * channels;
  }
  std::size_t rows() const { return channels == 0 ? 0 : values.size() / channels; }
};

using FaceList = std::span<const std::int32_t>;  // [F,3]

// Channel 3 of an image of rasterize: face + 1, 0 where there is none. CheckFaceIds has seen it.
template <class T>
std::int32_t FaceOf(const T* pixel) {
  return static_cast<std::int32_t>(pixel[3]) - 1;
}

// Names the first vertex index outside of [0, vertices).
Status CheckFaces(FaceList faces, std::size_t vertices);
inline constexpr std::size_t kNoPixel = std::numeric_limits<std::size_t>::max();
// Whether channel 3 of a pixel is a whole number in [0, faces].
template <class T>
bool IsFaceId(T id, std::size_t faces) {
  return id >= T(0) && id <= static_cast<T>(faces) &&
         id == static_cast<T>(static_cast<std::int64_t>(id));
}
// The error of a pixel of `rast` whose channel 3 is no such number.
Status NoSuchFace(std::size_t pixel, double id, std::size_t faces);
// Names the first such pixel of `rast` [pixels,4].
template <class T>
Status CheckFaceIds(std::span<const T> rast, std::size_t faces);

}  // namespace tilegrad::compat::nvdiffrast
