// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/error.h"
#include "deferred/band_sums.h"
#include "deferred/rasterize_input.h"

namespace tilegrad::deferred {
namespace {

// Channels of d_positions that rasterize pulls: x, y and w.
constexpr int kPulled[3] = {0, 1, 3};

template <class T>
BarycentricsCotangent<double> CotangentAt(const RasterizeCotangents<T>& all, std::size_t pixel) {
  BarycentricsCotangent<double> out{};
  if (!all.d_rast.empty()) {
    out.d_u = static_cast<double>(all.d_rast[4 * pixel]);
    out.d_v = static_cast<double>(all.d_rast[4 * pixel + 1]);
  }
  for (std::size_t i = 0; i < 4 && !all.d_rast_db.empty(); ++i) {
    out.d_slopes[i] = static_cast<double>(all.d_rast_db[4 * pixel + i]);
  }
  return out;
}

void AddCorners(const ClipCorners<double>& d, const std::size_t (&rows)[3],
                BandSums::Adder* adder) {
  for (int k = 0; k < 3; ++k) {
    double* to = adder->Row(rows[k]);
    const double values[3] = {d.x[k], d.y[k], d.w[k]};
    for (int i = 0; i < 3; ++i) to[kPulled[i]] += values[i];
  }
}

template <class T>
void PullBand(const RasterizeInput<T>& input, const RasterizeCotangents<T>& cotangents,
              const Band& band, BandSums::Adder* adder) {
  const PixelSize size = SizeOf(input.grid);
  LastFace<T> corners(input, band.image);
  for (int y = band.row_begin; y < band.row_end; ++y) {
    for (int x = 0; x < input.grid.width; ++x) {
      const std::size_t pixel = input.grid.first(band.image, y) + static_cast<std::size_t>(x);
      const std::int32_t face = FaceOf(&cotangents.rast[4 * pixel]);
      if (face < 0) continue;
      const ClipCorners<double>& c = corners(face);
      const PixelCentre at = CentreOf(input.grid, x, y);
      if (!BarycentricsAt(c, at, size).solid) continue;
      ClipCorners<double> d{};
      BarycentricsAdjoint(c, at, size, CotangentAt(cotangents, pixel), &d);
      std::size_t rows[3];
      for (int k = 0; k < 3; ++k) {
        rows[k] =
            input.positions.row(band.image, input.faces[3 * static_cast<std::size_t>(face) + k]);
      }
      AddCorners(d, rows, adder);
    }
  }
}

}  // namespace

template <class T>
Status RasterizeBackward(const RasterizeInput<T>& input, const RasterizeCotangents<T>& cotangents,
                         const Workers& workers, std::span<T> d_positions) {
  TILEGRAD_TRY(CheckInput(input));
  TILEGRAD_TRY(CheckFaceIds(cotangents.rast, input.faces.size() / 3));
  BandSums sums(input.positions.rows(), 4, input.grid.bands(), workers);
  workers.For(input.grid.bands(), [&](std::size_t index, std::size_t worker) {
    BandSums::Adder adder(&sums, index, worker);
    PullBand(input, cotangents, input.grid.band(index), &adder);
  });
  std::fill(d_positions.begin(), d_positions.end(), T(0));
  sums.AddTo(d_positions, workers);
  return {};
}

template Status RasterizeBackward(const RasterizeInput<float>&, const RasterizeCotangents<float>&,
                                  const Workers&, std::span<float>);
template Status RasterizeBackward(const RasterizeInput<double>&, const RasterizeCotangents<double>&,
                                  const Workers&, std::span<double>);

}  // namespace tilegrad::deferred
