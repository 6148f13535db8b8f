// SPDX-License-Identifier: Apache-2.0
// The pixels of N3MR's drawing that a face may cover, and those that it owns.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "rivals/n3mr.h"

namespace tilegrad::rivals {

// Pixels of the drawing whose centre may lie within the extent of three coordinates. In pixel units
// these round by up to 2^15 2^-24 = 2e-3 in float, at the far end of the largest drawing.
struct InnerRange {
  int begin, end;

  template <class T>
  InnerRange(const T c[3], int inner) {
    const auto pixel = [&](T v) {
      return std::clamp(ToInnerPixels(v, inner), T(-2), static_cast<T>(inner) + 1);
    };
    const T slack = T(4e-3), low = pixel(std::min({c[0], c[1], c[2]})) - slack;
    const T high = pixel(std::max({c[0], c[1], c[2]})) + slack;
    begin = std::max(0, static_cast<int>(std::ceil(low)));
    end = std::min(inner, static_cast<int>(std::floor(high)) + 1);
  }
};

// Calls visit(pixel, column, row) for the pixels of the drawing that faces[f] owns, row 0 at the
// bottom.
template <class T, class Visit>
void ForOwnPixels(const N3mrImageT<T>& image, std::int32_t f, const Visit& visit) {
  const N3mrFaceT<T>& face = image.faces[static_cast<std::size_t>(f)];
  const InnerRange columns(face.at.x, image.inner), rows(face.at.y, image.inner);
  for (int i = rows.begin; i < rows.end; ++i) {
    for (int j = columns.begin; j < columns.end; ++j) {
      const auto p = static_cast<std::size_t>(i * image.inner + j);
      if (image.owner[p] == f) visit(p, j, i);
    }
  }
}

// Faces that own no pixel have no gradient.
template <class T>
bool OwnsAPixel(const N3mrImageT<T>& image, std::int32_t f) {
  int own = 0;
  ForOwnPixels(image, f, [&](std::size_t, int, int) { ++own; });
  return own > 0;
}

}  // namespace tilegrad::rivals
