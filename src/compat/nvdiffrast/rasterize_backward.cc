// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <vector>

#include "base/error.h"
#include "base/scalar.h"
#include "compat/nvdiffrast/barycentrics.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "compat/nvdiffrast/rasterize_input.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

BarycentricsCotangent<double> CotangentAt(const RasterizeCotangents<double>& all,
                                          std::size_t pixel) {
  BarycentricsCotangent<double> out{};
  if (!all.d_rast.empty()) {
    out.d_u = all.d_rast[4 * pixel];
    out.d_v = all.d_rast[4 * pixel + 1];
  }
  for (std::size_t i = 0; i < 4 && !all.d_rast_db.empty(); ++i) {
    out.d_slopes[i] = all.d_rast_db[4 * pixel + i];
  }
  return out;
}

// Sums gradients on the current face before adding them to the face's vertices.
class FacePull {
 public:
  FacePull(const RasterizeInput<double>& input, std::size_t image, BandSums::Adder* adder)
      : input_(input), image_(image), adder_(adder) {}
  ~FacePull() { Flush(); }

  ClipCorners<double>* Of(std::int32_t face) {
    if (face != face_) {
      Flush();
      face_ = face;
    }
    return &sum_;
  }

 private:
  void Flush() {
    if (face_ == raster::kNoFace) return;
    const std::int32_t* v = &input_.faces[3 * static_cast<std::size_t>(face_)];
    for (int k = 0; k < 3; ++k) {
      double* to = adder_->Row(input_.positions.row(image_, v[k]));
      to[0] += sum_.x[k];
      to[1] += sum_.y[k];
      to[3] += sum_.w[k];  // z has no gradient
    }
    sum_ = {};
  }

  const RasterizeInput<double>& input_;
  std::size_t image_;
  BandSums::Adder* adder_;
  std::int32_t face_ = raster::kNoFace;
  ClipCorners<double> sum_{};
};

// Both return the first pixel with a face that does not exist, or kNoPixel.
std::size_t PullBand(const RasterizeInput<float>& input, const PixelCentres& centres,
                     const RasterizeCotangents<float>& cotangents, const Band& band,
                     BandSums::Adder* adder) {
  return PullBarycentrics(input, centres, cotangents, band, adder);
}
std::size_t PullBand(const RasterizeInput<double>& input, const PixelCentres& centres,
                     const RasterizeCotangents<double>& cotangents, const Band& band,
                     BandSums::Adder* adder) {
  const PixelSize size = SizeOf(input.grid);
  LastFace corners(input, band.image);
  FacePull pull(input, band.image, adder);
  for (int y = band.row_begin; y < band.row_end; ++y) {
    for (std::size_t x = 0; x < input.grid.row(); ++x) {
      const std::size_t pixel = input.grid.first(band.image, y) + x;
      const double* rast = &cotangents.rast[4 * pixel];
      if (!IsFaceId(rast[3], input.faces.size() / 3)) return pixel;
      const std::int32_t face = FaceOf(rast);
      if (face < 0) continue;
      const PixelCentre centre{centres.x[x], centres.y[static_cast<std::size_t>(y)]};
      BarycentricsAdjoint(corners(face), centre, size, CotangentAt(cotangents, pixel),
                          pull.Of(face));
    }
  }
  return kNoPixel;
}

}  // namespace

template <class T>
Status RasterizeBackward(const RasterizeInput<T>& input, const RasterizeCotangents<T>& cotangents,
                         const Workers& workers, std::span<T> d_positions) {
  TILEGRAD_TRY(CheckInput(input));
  const PixelCentres centres(input.grid);
  std::vector<std::size_t> bad(input.grid.bands());
  BandSums sums(input.positions.rows(), 4, bad.size(), workers);
  workers.For(bad.size(), [&](std::size_t index, std::size_t worker) {
    BandSums::Adder adder(&sums, index, worker);
    bad[index] = PullBand(input, centres, cotangents, input.grid.band(index), &adder);
  });
  TILEGRAD_TRY(CheckNoPixel<T>(bad, cotangents.rast, input.faces.size() / 3));
  std::fill(d_positions.begin(), d_positions.end(), T(0));
  sums.AddTo(d_positions, workers);
  return {};
}

TILEGRAD_INSTANTIATE(RasterizeBackward);

}  // namespace tilegrad::compat::nvdiffrast
