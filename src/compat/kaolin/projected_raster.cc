// SPDX-License-Identifier: Apache-2.0
#include "compat/kaolin/projected_raster.h"

#include <algorithm>
#include <vector>

#include "base/scalar.h"
#include "compat/kaolin/face_visibility.h"
#include "raster/conventions.h"
#include "render/validate.h"

namespace tilegrad::compat::kaolin {
namespace {

constexpr std::size_t kBandRows = 64;
constexpr std::size_t kFacesPerTask = 256;

// Rows [row, row_end) of an image, from their first pixel on.
struct RowsOfImage {
  std::size_t row, row_end;
  const std::int32_t* face_ids;
};

// Features [F,3,C] of an image at the pixels of some rows.
template <class T>
void InterpolateRows(const ProjectedFacesT<T>& faces, const PixelCentresT<T>& pixels, T eps,
                     const T* features, std::size_t channels, const RowsOfImage& rows, T* out) {
  const std::int32_t* id = rows.face_ids;
  for (std::size_t i = rows.row; i < rows.row_end; ++i) {
    for (std::size_t j = 0; j < pixels.width; ++j, ++id, out += channels) {
      if (*id == raster::kNoFace) {
        std::fill_n(out, channels, T(0));
        continue;
      }
      const auto face = static_cast<std::size_t>(*id);
      const auto w = ScreenWeights(faces.corners(face), pixels.x[j], pixels.y[i], eps);
      const T* f = features + 3 * face * channels;
      for (std::size_t c = 0; c < channels; ++c) {
        out[c] = w[0] * f[c] + w[1] * f[channels + c] + w[2] * f[2 * channels + c];
      }
    }
  }
}

using PixelsOfFaces = EntriesOfFaces<std::uint32_t>;

// The backward pass of one face of one image.
template <class T>
struct FaceAdjoint {
  const T* corners;   // [3,2]
  const T* features;  // [3,C]
  const T* d_image;   // [H,W,C] of the image
  std::size_t channels;
  std::span<const std::uint32_t> pixels;  // that show it
};

// sums [3,C] <- D_kc.
template <class T>
void SumFeatures(const FaceAdjoint<T>& face, const PixelCentresT<T>& pixels, T eps,
                 std::span<double> sums) {
  std::fill(sums.begin(), sums.end(), 0.0);
  for (const std::uint32_t pixel : face.pixels) {
    const auto w = ScreenWeights(face.corners, pixels.x[pixel % pixels.width],
                                 pixels.y[pixel / pixels.width], eps);
    const T* d = face.d_image + pixel * face.channels;
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t c = 0; c < face.channels; ++c) {
        sums[k * face.channels + c] += static_cast<double>(w[k] * d[c]);
      }
    }
  }
}

// d_xy [3,2] of a face, from its D_kc: the formula of the header.
template <class T>
void CornersFromFeatures(const FaceAdjoint<T>& face, double eps, std::span<const double> sums,
                         T* d_xy) {
  double v[6], gx[3], gy[3];
  std::copy_n(face.corners, 6, v);
  for (int k = 0; k < 3; ++k) {  // grad W_k, which is dS/dv_k too
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    gx[k] = v[2 * a + 1] - v[2 * b + 1];
    gy[k] = v[2 * b] - v[2 * a];
  }
  const double area = gy[2] * gx[1] - gx[2] * gy[1];
  if (area == 0) return;
  const double denominator = WeightDenominator(area, eps);
  double moved = 0;  // sum_kc f_kc D_kc
  double along_x[3] = {}, along_y[3] = {};
  for (std::size_t c = 0; c < face.channels; ++c) {
    double slope_x = 0, slope_y = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto f = static_cast<double>(face.features[k * face.channels + c]);
      slope_x += f * gx[k] / area;
      slope_y += f * gy[k] / area;
      moved += f * sums[k * face.channels + c];
    }
    for (std::size_t m = 0; m < 3; ++m) {
      along_x[m] -= sums[m * face.channels + c] * slope_x;
      along_y[m] -= sums[m * face.channels + c] * slope_y;
    }
  }
  const double through_eps = moved * (denominator - area) / (area * denominator);
  for (std::size_t m = 0; m < 3; ++m) {
    d_xy[2 * m] = static_cast<T>(along_x[m] + through_eps * gx[m]);
    d_xy[2 * m + 1] = static_cast<T>(along_y[m] + through_eps * gy[m]);
  }
}

template <class T>
Status ValidateFeatures(const ProjectedBatchT<T>& batch, std::span<const T> features,
                        std::size_t channels) {
  TILEGRAD_TRY(
      CheckSize("face_features", features.size(), 3 * batch.images * batch.faces * channels));
  return CheckFinite("face_features", features);
}

template <class T>
Status ValidateAdjoint(const ProjectedBatchT<T>& batch, const ImageSize& size, std::size_t channels,
                       const ProjectedRasterAdjoint<T>& adjoint) {
  const std::size_t pixels = batch.images * PixelCount(size);
  TILEGRAD_TRY(CheckSize("face_idx", adjoint.face_ids.size(), pixels));
  TILEGRAD_TRY(CheckSize("the gradient of the image", adjoint.d_image.size(), pixels * channels));
  TILEGRAD_TRY(CheckFinite("the gradient of the image", adjoint.d_image));
  if (!adjoint.d_xy.empty()) {
    TILEGRAD_TRY(CheckSize("d_face_vertices_image", adjoint.d_xy.size(), batch.xy.size()));
  }
  if (adjoint.d_features.empty()) return {};
  return CheckSize("d_face_features", adjoint.d_features.size(),
                   3 * batch.images * batch.faces * channels);
}

}  // namespace

template <class T>
Status RasterizeProjected(const ProjectedBatchT<T>& batch, const ProjectedRasterOptions& options,
                          std::span<const T> features, std::size_t channels, const Workers& workers,
                          std::span<std::int32_t> face_ids, std::span<T> image) {
  TILEGRAD_TRY(ValidateProjected(batch, options.size, {}));
  TILEGRAD_TRY(CheckNotNegative("eps", options.eps));
  TILEGRAD_TRY(CheckSize("face_vertices_z", batch.z.size(), 3 * batch.images * batch.faces));
  TILEGRAD_TRY(CheckFinite("face_vertices_z", batch.z));
  TILEGRAD_TRY(ValidateFeatures(batch, features, channels));
  const std::size_t pixels = PixelCount(options.size);
  TILEGRAD_TRY(CheckSize("face_idx", face_ids.size(), batch.images * pixels));
  TILEGRAD_TRY(CheckSize("the image", image.size(), batch.images * pixels * channels));
  const PixelCentresT<T> centres(options.size.width, options.size.height);
  const T eps = static_cast<T>(options.eps);
  const std::size_t bands = (centres.height + kBandRows - 1) / kBandRows;
  std::vector<FaceVisibilityScratchT<T>> scratch(workers.size());
  workers.For(batch.images * bands, [&](std::size_t task, std::size_t worker) {
    const std::size_t n = task / bands, row = task % bands * kBandRows;
    const std::size_t row_end = std::min(row + kBandRows, centres.height);
    const std::size_t first = n * pixels + row * centres.width;
    const auto faces = batch.image(n);
    std::int32_t* ids = face_ids.data() + first;
    FaceVisibility(faces, centres, eps, row, row_end, &scratch[worker], ids);
    if (channels == 0) return;
    InterpolateRows(faces, centres, eps, features.data() + 3 * n * batch.faces * channels, channels,
                    {row, row_end, ids}, image.data() + first * channels);
  });
  return {};
}

template <class T>
Status RasterizeProjectedBackward(const ProjectedBatchT<T>& batch,
                                  const ProjectedRasterOptions& options,
                                  std::span<const T> features, std::size_t channels,
                                  const Workers& workers,
                                  const ProjectedRasterAdjoint<T>& adjoint) {
  TILEGRAD_TRY(ValidateProjected(batch, options.size, adjoint.face_ids));
  TILEGRAD_TRY(CheckNotNegative("eps", options.eps));
  TILEGRAD_TRY(ValidateFeatures(batch, features, channels));
  TILEGRAD_TRY(ValidateAdjoint(batch, options.size, channels, adjoint));
  const PixelCentresT<T> centres(options.size.width, options.size.height);
  const std::size_t pixels = PixelCount(options.size);
  std::vector<PixelsOfFaces> lists(batch.images, PixelsOfFaces(adjoint.face_ids.first(0), 0));
  workers.For(batch.images, [&](std::size_t n) {
    lists[n] = PixelsOfFaces(adjoint.face_ids.subspan(n * pixels, pixels), batch.faces);
  });
  std::vector<std::vector<double>> sums(workers.size(), std::vector<double>(3 * channels));
  const auto backward = [&](std::size_t index, std::span<double> d_features) {
    const std::size_t n = index / batch.faces;
    const std::size_t from = 3 * index * channels;
    const FaceAdjoint<T> face{batch.xy.data() + 6 * index, features.data() + from,
                              adjoint.d_image.data() + n * pixels * channels, channels,
                              lists[n].of(index % batch.faces)};
    if (!adjoint.d_xy.empty()) std::fill_n(adjoint.d_xy.data() + 6 * index, 6, T(0));
    SumFeatures(face, centres, static_cast<T>(options.eps), d_features);
    if (!adjoint.d_features.empty()) {
      std::copy(d_features.begin(), d_features.end(), adjoint.d_features.data() + from);
    }
    if (face.pixels.empty() || adjoint.d_xy.empty()) return;
    CornersFromFeatures(face, options.eps, d_features, adjoint.d_xy.data() + 6 * index);
  };
  workers.ForRanges(batch.images * batch.faces, kFacesPerTask,
                    [&](std::size_t begin, std::size_t end, std::size_t worker) {
                      for (std::size_t i = begin; i < end; ++i) backward(i, sums[worker]);
                    });
  TILEGRAD_TRY(CheckFinite("d_face_vertices_image", std::span<const T>(adjoint.d_xy)));
  return CheckFinite("d_face_features", std::span<const T>(adjoint.d_features));
}

TILEGRAD_INSTANTIATE(RasterizeProjected);
TILEGRAD_INSTANTIATE(RasterizeProjectedBackward);

}  // namespace tilegrad::compat::kaolin
