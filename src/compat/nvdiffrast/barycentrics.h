// SPDX-License-Identifier: Apache-2.0
// Vector kernels of rasterize.h for positions of float: barycentrics_ref.h at the pixels of an
// image, in double, with the same bits on every instruction set, and the adjoint.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "compat/nvdiffrast/rasterize.h"

namespace tilegrad::compat::nvdiffrast {

// Centres of the pixels of an image in normalised device coordinates, those of CentreOf.
struct PixelCentres {
  static constexpr std::size_t kPadding = 16;  // columns for whole vectors
  AlignedVector<double> x;                     // [W + kPadding]
  AlignedVector<double> y;                     // [H]

  explicit PixelCentres(const PixelGrid& grid);
};

// The visible faces of a row of a bin.
struct BinRow {
  std::size_t image;
  int x, y;
  std::size_t count;                     // pixels, at most raster::kBinSize
  const std::int32_t* seen;              // [raster::kBinSize] of `source`, or kNoFace
  std::span<const std::int32_t> source;  // faces of the caller
};

// Writes rast, and rast_db unless it is empty.
void WriteBarycentrics(const RasterizeInput<float>& input, const PixelCentres& centres,
                       const BinRow& row, const RasterizeOutput<float>& out);

// Adds the gradients of a band's pixels to the positions of their faces: of adjacent pixels of a
// face summed in pixel order, then to the rows of its corners. Returns the first pixel with a face
// that does not exist, or kNoPixel.
std::size_t PullBarycentrics(const RasterizeInput<float>& input, const PixelCentres& centres,
                             const RasterizeCotangents<float>& cotangents, const Band& band,
                             BandSums::Adder* adder);

}  // namespace tilegrad::compat::nvdiffrast
