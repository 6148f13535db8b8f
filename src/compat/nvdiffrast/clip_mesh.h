// SPDX-License-Identifier: Apache-2.0
// Inputs of nvdiffrast's operations: faces over vertices, and an image with a face id at every
// pixel.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "tilegrad/status.h"

namespace tilegrad::compat::nvdiffrast {

// Rows of numbers at vertices: positions in clip space (4), or attributes.
template <class T>
struct VertexRows {
  std::span<const T> values;  // [N,V,C], or [V,C] if shared by all images
  std::size_t vertices = 0, channels = 0;
  bool shared = false;

  // Row index of a vertex.
  std::size_t row(std::size_t image, std::int32_t vertex) const {
    return (shared ? 0 : image * vertices) + static_cast<std::size_t>(vertex);
  }
  const T* at(std::size_t image, std::int32_t vertex) const {
    return values.data() + row(image, vertex) * channels;
  }
  std::size_t rows() const { return channels == 0 ? 0 : values.size() / channels; }
};

using FaceList = std::span<const std::int32_t>;  // [F,3]

// Channel 3 of an image of rasterize: face + 1, 0 for none. Must have passed CheckFaceIds.
template <class T>
std::int32_t FaceOf(const T* pixel) {
  return static_cast<std::int32_t>(pixel[3]) - 1;
}

// An error that names the first vertex index outside of [0, vertices).
Status CheckFaces(FaceList faces, std::size_t vertices);
inline constexpr std::size_t kNoPixel = std::numeric_limits<std::size_t>::max();
// Whether channel 3 of a pixel is an integer in [0, faces].
template <class T>
bool IsFaceId(T id, std::size_t faces) {
  return id >= T(0) && id <= static_cast<T>(faces) &&
         id == static_cast<T>(static_cast<std::int64_t>(id));
}
// The error for a pixel of `rast` with an invalid channel 3.
Status NoSuchFace(std::size_t pixel, double id, std::size_t faces);
// An error that names the first such pixel of `rast` [pixels,4].
Status CheckFaceIds(std::span<const double> rast, std::size_t faces);
// The same, of the first such pixel of each band, kNoPixel for none.
template <class T>
Status CheckNoPixel(std::span<const std::size_t> bad, std::span<const T> rast, std::size_t faces);

// The images that nvdiffrast's operations read and write, and how they are split into tasks.
//
// All are [N,H,W,C], rows from the bottom: pixel (X, Y) has its centre at x/w = 2 (X + 0.5) / W -
// 1, y/w = 2 (Y + 0.5) / H - 1, the coordinates of OpenGL.

inline constexpr int kBandRows = 64;

// Rows [row_begin, row_end) of an image: the unit of work. Sums are formed per band and then merged
// in band order.
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
  // Index in the batch of a row's first pixel.
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

// Calls visit(pixel index in the batch) for each pixel of a band, in order.
template <class Visit>
void ForEachPixel(const PixelGrid& grid, const Band& band, const Visit& visit) {
  const std::size_t end = grid.first(band.image, band.row_end);
  for (std::size_t p = grid.first(band.image, band.row_begin); p < end; ++p) visit(p);
}

// Sums pixels' gradient contributions to rows (of vertices, of texels), with the same bits for any
// number of workers. Every band sums the rows that it touches separately, in double and in pixel
// order; the sums of bands are then added in band order.

class BandSums {
 public:
  // Rows [0, rows) of `channels` numbers; a band may touch at most 2^31 - 1 rows.
  BandSums(std::size_t rows, std::size_t channels, std::size_t bands, const Workers& workers);

  // Accumulates one band. Only one Adder per worker at a time.
  class Adder {
   public:
    Adder(BandSums* sums, std::size_t band, std::size_t worker);
    ~Adder();
    Adder(const Adder&) = delete;
    Adder& operator=(const Adder&) = delete;

    // Discards what was added.
    void Clear();

    // The sum of a row so far; valid until the next call.
    double* Row(std::size_t row) {
      if (slots_[row] == 0) MeetRow(row);
      return sums_.data() + static_cast<std::size_t>(slots_[row] - 1) * channels_;
    }
    // The rows touched, in order of first use, and their sums, concatenated.
    std::span<const std::size_t> rows() const { return rows_; }
    const double* sums() const { return sums_.data(); }

   private:
    void MeetRow(std::size_t row);

    std::vector<std::size_t>& rows_;
    std::vector<double>& sums_;
    std::int32_t* slots_;
    std::size_t channels_;
  };

  // out [n,channels] += the sums of all bands, of rows first to first + n - 1. Saturates.
  template <class T>
  void AddTo(std::span<T> out, const Workers& workers, std::size_t first = 0) const;

 private:
  struct OfBand {
    std::vector<std::size_t> rows;  // in order of first use
    std::vector<double> sums;       // [rows][channels]
  };
  template <class T>
  void AddRows(std::span<T> out, std::size_t begin, std::size_t end, std::size_t first) const;

  std::size_t rows_, channels_;
  std::vector<OfBand> bands_;
  // Per worker: 1 + position of a row in the current band; 0 if not touched.
  std::vector<AlignedVector<std::int32_t>> slots_;
};

}  // namespace tilegrad::compat::nvdiffrast
