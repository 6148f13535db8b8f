// SPDX-License-Identifier: Apache-2.0
// The images that nvdiffrast's operations read and write, and how they are split into tasks.
//
// All are [N,H,W,C], rows from the bottom: pixel (X, Y) has its centre at x/w = 2 (X + 0.5) / W -
// 1, y/w = 2 (Y + 0.5) / H - 1, the coordinates of OpenGL.
#pragma once

#include <algorithm>
#include <cstddef>

#include "base/parallel.h"

namespace tilegrad::compat::nvdiffrast {

inline constexpr int kBandRows = 64;

// Rows [row_begin, row_end) of an image: the unit of work. Sums are made by bands and then merged
// in their order.
struct Band {
  std::size_t index, image;
  int row_begin, row_end;
};

struct PixelGrid {
  std::size_t images = 0;
  int height = 0, width = 0;

  std::size_t row() const { return static_cast<std::size_t>(width); }
  std::size_t image() const { return static_cast<std::size_t>(height) * row(); }
  std::size_t pixels() const { return images * image(); }
  std::size_t bands_of_image() const {
    return static_cast<std::size_t>((height + kBandRows - 1) / kBandRows);
  }
  std::size_t bands() const { return images * bands_of_image(); }
  Band band(std::size_t index) const {
    const auto part = static_cast<int>(index % bands_of_image());
    return {index, index / bands_of_image(), part * kBandRows,
            std::min(height, (part + 1) * kBandRows)};
  }
  // The first pixel of a row, counted over the batch.
  std::size_t first(std::size_t image_index, int y) const {
    return image_index * image() + static_cast<std::size_t>(y) * row();
  }
};

// The centre of a pixel in normalised device coordinates.
struct PixelCentre {
  double x, y;
};
inline PixelCentre CentreOf(const PixelGrid& grid, int column, int row) {
  return {(2.0 * column + 1.0) / grid.width - 1.0, (2.0 * row + 1.0) / grid.height - 1.0};
}

// Calls visit(pixel of the batch) for each pixel of a band, in order.
template <class Visit>
void ForEachPixel(const PixelGrid& grid, const Band& band, const Visit& visit) {
  const std::size_t end = grid.first(band.image, band.row_end);
  for (std::size_t p = grid.first(band.image, band.row_begin); p < end; ++p) visit(p);
}

}  // namespace tilegrad::compat::nvdiffrast
