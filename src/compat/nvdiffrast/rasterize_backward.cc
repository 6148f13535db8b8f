// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/error.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "compat/nvdiffrast/rasterize_input.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

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

// Sums gradients on the current face before adding them to the face's vertices.
template <class T>
class FacePull {
 public:
  FacePull(const RasterizeInput<T>& input, std::size_t image, BandSums::Adder* adder)
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

  const RasterizeInput<T>& input_;
  std::size_t image_;
  BandSums::Adder* adder_;
  std::int32_t face_ = raster::kNoFace;
  ClipCorners<double> sum_{};
};

template <class T>
void PullBand(const RasterizeInput<T>& input, const RasterizeCotangents<T>& cotangents,
              const Band& band, BandSums::Adder* adder) {
  const PixelSize size = SizeOf(input.grid);
  LastFace<T> corners(input, band.image);
  FacePull<T> pull(input, band.image, adder);
  for (int y = band.row_begin; y < band.row_end; ++y) {
    for (int x = 0; x < input.grid.width; ++x) {
      const std::size_t pixel = input.grid.first(band.image, y) + static_cast<std::size_t>(x);
      const std::int32_t face = FaceOf(&cotangents.rast[4 * pixel]);
      if (face < 0) continue;
      BarycentricsAdjoint(corners(face), CentreOf(input.grid, x, y), size,
                          CotangentAt(cotangents, pixel), pull.Of(face));
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

}  // namespace tilegrad::compat::nvdiffrast
