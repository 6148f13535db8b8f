// SPDX-License-Identifier: Apache-2.0
// Scalar reference of interpolate.h, for validated input: pixel by pixel, in double. T: float,
// double.
#pragma once

#include <algorithm>

#include "compat/nvdiffrast/interpolate.h"

namespace tilegrad::compat::nvdiffrast {
namespace interpolate_ref {

// The attribute rows of a pixel's face; weights, and their derivatives if known.
template <class T>
struct PixelFace {
  std::size_t rows[3];
  const T* corner[3];
  double weight[3];
  double slope[3][2];
};

template <class T>
PixelFace<T> FaceAt(const InterpolateInput<T>& input, std::size_t image, std::size_t pixel) {
  const T* rast = &input.rast[4 * pixel];
  PixelFace<T> out;
  for (int k = 0; k < 3; ++k) {
    const std::int32_t v = input.faces[3 * static_cast<std::size_t>(FaceOf(rast)) + k];
    out.rows[k] = input.attributes.row(image, v);
    out.corner[k] = input.attributes.at(image, v);
  }
  const double u = static_cast<double>(rast[0]), v = static_cast<double>(rast[1]);
  out.weight[0] = u;
  out.weight[1] = v;
  out.weight[2] = 1 - u - v;
  for (int i = 0; i < 2 && !input.rast_db.empty(); ++i) {
    const T* db = &input.rast_db[4 * pixel];
    out.slope[0][i] = static_cast<double>(db[i]);
    out.slope[1][i] = static_cast<double>(db[2 + i]);
    out.slope[2][i] = -(out.slope[0][i] + out.slope[1][i]);
  }
  return out;
}

// One attribute at the three corners.
template <class T>
double Mix(const PixelFace<T>& face, std::size_t channel, const double (&weight)[3]) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += weight[k] * static_cast<double>(face.corner[k][channel]);
  return sum;
}

template <class T>
void WritePixel(const InterpolateInput<T>& input, const PixelFace<T>& face, T* out, T* out_da) {
  for (std::size_t c = 0; c < input.attributes.channels; ++c) {
    out[c] = static_cast<T>(Mix(face, c, face.weight));
  }
  for (const std::int32_t channel : input.diff_attrs) {
    for (int i = 0; i < 2; ++i) {
      const double slope[3] = {face.slope[0][i], face.slope[1][i], face.slope[2][i]};
      *out_da++ = static_cast<T>(Mix(face, static_cast<std::size_t>(channel), slope));
    }
  }
}

// Gradients from the cotangents of a pixel.
struct PixelPull {
  double d_weight[3] = {}, d_slope[3][2] = {};
};

template <class T>
PixelPull PullWeights(const InterpolateInput<T>& input, const PixelFace<T>& face, const T* d_out,
                      const T* d_da) {
  PixelPull pull;
  for (int k = 0; k < 3; ++k) {
    for (std::size_t c = 0; c < input.attributes.channels; ++c) {
      pull.d_weight[k] += static_cast<double>(d_out[c]) * static_cast<double>(face.corner[k][c]);
    }
    if (d_da == nullptr) continue;
    for (std::size_t d = 0; d < input.diff_attrs.size(); ++d) {
      const auto a =
          static_cast<double>(face.corner[k][static_cast<std::size_t>(input.diff_attrs[d])]);
      for (int i = 0; i < 2; ++i) pull.d_slope[k][i] += a * static_cast<double>(d_da[2 * d + i]);
    }
  }
  return pull;
}

template <class T>
void PullAttributes(const InterpolateInput<T>& input, const PixelFace<T>& face, const T* d_out,
                    const T* d_da, BandSums::Adder* adder) {
  for (int k = 0; k < 3; ++k) {
    double* to = adder->Row(face.rows[k]);
    for (std::size_t c = 0; c < input.attributes.channels; ++c) {
      to[c] += face.weight[k] * static_cast<double>(d_out[c]);
    }
    if (d_da == nullptr) continue;
    for (std::size_t d = 0; d < input.diff_attrs.size(); ++d) {
      double& sum = to[static_cast<std::size_t>(input.diff_attrs[d])];
      for (int i = 0; i < 2; ++i) sum += face.slope[k][i] * static_cast<double>(d_da[2 * d + i]);
    }
  }
}

template <class T>
void WriteWeights(const PixelPull& pull, std::size_t pixel, const InterpolateGradients<T>& out) {
  for (std::size_t i = 0; i < 2; ++i) {
    if (!out.d_rast.empty()) {
      out.d_rast[4 * pixel + i] = static_cast<T>(pull.d_weight[i] - pull.d_weight[2]);
    }
    if (out.d_rast_db.empty()) continue;
    for (std::size_t j = 0; j < 2; ++j) {
      out.d_rast_db[4 * pixel + 2 * i + j] =
          static_cast<T>(pull.d_slope[i][j] - pull.d_slope[2][j]);
    }
  }
}

template <class T>
void PullPixel(const InterpolateInput<T>& input, const InterpolateCotangents<T>& d,
               std::size_t image, std::size_t pixel, BandSums::Adder* adder,
               const InterpolateGradients<T>& out) {
  for (const auto& to : {out.d_rast, out.d_rast_db}) {
    if (!to.empty()) std::fill_n(&to[4 * pixel], 4, T(0));
  }
  if (FaceOf(&input.rast[4 * pixel]) < 0) return;
  const PixelFace<T> face = FaceAt(input, image, pixel);
  const T* d_out = &d.d_out[pixel * input.attributes.channels];
  const T* d_da = d.d_out_da.empty() ? nullptr : &d.d_out_da[pixel * 2 * input.diff_attrs.size()];
  if (!out.d_rast.empty() || !out.d_rast_db.empty()) {
    WriteWeights(PullWeights(input, face, d_out, d_da), pixel, out);
  }
  if (!out.d_attributes.empty()) PullAttributes(input, face, d_out, d_da, adder);
}

// One pixel of out and out_da.
template <class T>
void InterpolatePixel(const InterpolateInput<T>& input, std::size_t image, std::size_t pixel,
                      const InterpolateOutput<T>& out) {
  const std::size_t channels = input.attributes.channels, da = 2 * input.diff_attrs.size();
  T *to = out.out.data() + pixel * channels, *to_da = out.out_da.data() + pixel * da;
  if (FaceOf(&input.rast[4 * pixel]) < 0) {
    std::fill(to, to + channels, T(0));
    std::fill(to_da, to_da + da, T(0));
  } else {
    WritePixel(input, FaceAt(input, image, pixel), to, to_da);
  }
}

}  // namespace interpolate_ref

template <class T>
void InterpolateRef(const InterpolateInput<T>& input, const Workers& workers,
                    const InterpolateOutput<T>& out) {
  workers.For(input.grid.bands(), [&](std::size_t index) {
    const Band band = input.grid.band(index);
    ForEachPixel(input.grid, band, [&](std::size_t pixel) {
      interpolate_ref::InterpolatePixel(input, band.image, pixel, out);
    });
  });
}

template <class T>
void InterpolateBackwardRef(const InterpolateInput<T>& input,
                            const InterpolateCotangents<T>& cotangents, const Workers& workers,
                            const InterpolateGradients<T>& out) {
  BandSums sums(input.attributes.rows(), input.attributes.channels, input.grid.bands(), workers);
  workers.For(input.grid.bands(), [&](std::size_t index, std::size_t worker) {
    BandSums::Adder adder(&sums, index, worker);
    const Band band = input.grid.band(index);
    ForEachPixel(input.grid, band, [&](std::size_t pixel) {
      interpolate_ref::PullPixel(input, cotangents, band.image, pixel, &adder, out);
    });
  });
  if (out.d_attributes.empty()) return;
  std::fill(out.d_attributes.begin(), out.d_attributes.end(), T(0));
  sums.AddTo(out.d_attributes, workers);
}

}  // namespace tilegrad::compat::nvdiffrast
