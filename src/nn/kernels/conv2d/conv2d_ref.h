// SPDX-License-Identifier: Apache-2.0
// Scalar reference of conv2d.h. T: float, double or std::complex<double>.
#pragma once

#include <algorithm>

#include "nn/kernels/conv2d/conv2d.h"

namespace tilegrad::nn {

// One product of the sums above: y[y_index] pairs with w[w_index] x[x_index].
struct Conv2dTap {
  std::size_t x_index, w_index, y_index;
};

// Calls visit(tap) for every product whose x lies inside the image, ordered by (o, n, i, j, c, u,
// v). All three functions below are this one enumeration.
template <class Visit>
void ForEachConv2dTap(const Conv2dShape& s, const Visit& visit) {
  const auto row = [&](std::size_t o, std::size_t n, std::size_t i, std::size_t j, std::size_t c,
                       std::size_t u) {
    const std::size_t y_index = ((n * s.out_channels + o) * s.out_height() + i) * s.out_width() + j;
    const std::size_t h = i * s.stride + u - s.padding;  // wraps below 0, to >= height
    for (std::size_t v = 0; v < s.kernel_width; ++v) {
      const std::size_t w = j * s.stride + v - s.padding;
      if (h >= s.in_height || w >= s.in_width) continue;
      visit(Conv2dTap{((n * s.in_channels + c) * s.in_height + h) * s.in_width + w,
                      ((o * s.in_channels + c) * s.kernel_height + u) * s.kernel_width + v,
                      y_index});
    }
  };
  const auto pixel = [&](std::size_t o, std::size_t n, std::size_t i, std::size_t j) {
    for (std::size_t c = 0; c < s.in_channels; ++c) {
      for (std::size_t u = 0; u < s.kernel_height; ++u) row(o, n, i, j, c, u);
    }
  };
  for (std::size_t o = 0; o < s.out_channels; ++o) {
    for (std::size_t n = 0; n < s.batch; ++n) {
      for (std::size_t i = 0; i < s.out_height(); ++i) {
        for (std::size_t j = 0; j < s.out_width(); ++j) pixel(o, n, i, j);
      }
    }
  }
}

template <class T>
void Conv2dForwardRef(const Conv2dShape& s, const T* x, const T* weight, const T* bias, T* y) {
  for (std::size_t i = 0; i < s.out_size(); ++i) {
    y[i] = bias == nullptr ? T{} : bias[i / s.out_pixels() % s.out_channels];
  }
  ForEachConv2dTap(s,
                   [&](const Conv2dTap& t) { y[t.y_index] += weight[t.w_index] * x[t.x_index]; });
}

template <class T>
void Conv2dInputGradRef(const Conv2dShape& s, const T* d_y, const T* weight, T* d_x) {
  std::fill_n(d_x, s.in_size(), T{});
  ForEachConv2dTap(
      s, [&](const Conv2dTap& t) { d_x[t.x_index] += weight[t.w_index] * d_y[t.y_index]; });
}

template <class T>
void Conv2dWeightGradRef(const Conv2dShape& s, const T* x, const T* d_y, T* d_weight) {
  std::fill_n(d_weight, s.weight_size(), T{});
  ForEachConv2dTap(
      s, [&](const Conv2dTap& t) { d_weight[t.w_index] += d_y[t.y_index] * x[t.x_index]; });
}

}  // namespace tilegrad::nn
