// SPDX-License-Identifier: Apache-2.0
// The truth of texture.h. T: float, double, std::complex<double> (coordinates and texels carry a
// complex step; the choice of texels follows the real part).
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>

#include "shade/texture.h"

namespace tilegrad::shade {
namespace texture_ref {

template <class T>
T Real(T x) {
  return x;
}
template <class T>
T Real(std::complex<T> x) {
  return x.real();
}

inline int WrapIndex(std::int64_t i, int n, Wrap wrap) {
  if (wrap == Wrap::kClamp) return static_cast<int>(std::clamp<std::int64_t>(i, 0, n - 1));
  const std::int64_t r = i % n;
  return static_cast<int>(r < 0 ? r + n : r);
}

// One axis of the filter: texels `low` and `high`, weight of `high`.
template <class T>
struct Axis {
  int low, high;
  T weight;
};

// `x` in texels, 0 at the border of the first. Coordinates beyond 2^40 texels carry no fraction;
// they are taken as 0, so that no conversion overflows.
template <class T>
Axis<T> FilterAxis(T x, int n, Wrap wrap) {
  const T at = std::abs(Real(x)) < 0x1p40 ? x - T(0.5) : T(0);
  const auto cell = static_cast<std::int64_t>(std::floor(Real(at)));
  return {WrapIndex(cell, n, wrap), WrapIndex(cell + 1, n, wrap),
          at - T(static_cast<decltype(Real(at))>(cell))};
}

template <class T>
struct Footprint {
  Axis<T> column, row;
  std::size_t texel[4];  // offsets of the upper left, upper right, lower left, lower right texel
};

template <class T>
Footprint<T> MakeFootprint(const TextureViewT<T>& texture, T u, T v) {
  const auto w = static_cast<float>(texture.width), h = static_cast<float>(texture.height);
  Footprint<T> out{FilterAxis(u * T(w), texture.width, texture.wrap),
                   FilterAxis((T(1) - v) * T(h), texture.height, texture.wrap),
                   {}};
  const int rows[2] = {out.row.low, out.row.high}, columns[2] = {out.column.low, out.column.high};
  for (int k = 0; k < 4; ++k) {
    const auto texel = static_cast<std::size_t>(rows[k / 2]) * texture.width + columns[k % 2];
    out.texel[k] = texel * static_cast<std::size_t>(texture.channels);
  }
  return out;
}

}  // namespace texture_ref

// color[channels] <- the bilinear value at (u, v).
template <class T>
void SampleBilinearRef(const TextureViewT<T>& texture, T u, T v, std::span<T> color) {
  const auto at = texture_ref::MakeFootprint(texture, u, v);
  const T a = at.column.weight, b = at.row.weight;
  for (std::size_t c = 0; c < static_cast<std::size_t>(texture.channels); ++c) {
    const T* t = texture.texels.data() + c;
    const T top = t[at.texel[0]] + a * (t[at.texel[1]] - t[at.texel[0]]);
    const T bottom = t[at.texel[2]] + a * (t[at.texel[3]] - t[at.texel[2]]);
    color[c] = top + b * (bottom - top);
  }
}

// Adds to d_uv[2] and d_texels (as texture.texels; may be empty) what d_color[channels] pulls back.
template <class T>
void SampleBilinearAdjointRef(const TextureViewT<T>& texture, T u, T v, std::span<const T> d_color,
                              std::span<T> d_uv, std::span<T> d_texels) {
  const auto at = texture_ref::MakeFootprint(texture, u, v);
  const T a = at.column.weight, b = at.row.weight;
  const T weights[4] = {(T(1) - a) * (T(1) - b), a * (T(1) - b), (T(1) - a) * b, a * b};
  T d_a = 0, d_b = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(texture.channels); ++c) {
    const T* t = texture.texels.data() + c;
    const T t0 = t[at.texel[0]], t1 = t[at.texel[1]], t2 = t[at.texel[2]], t3 = t[at.texel[3]];
    d_a += d_color[c] * ((T(1) - b) * (t1 - t0) + b * (t3 - t2));
    d_b += d_color[c] * ((T(1) - a) * (t2 - t0) + a * (t3 - t1));
    if (d_texels.empty()) continue;
    for (int k = 0; k < 4; ++k) d_texels[at.texel[k] + c] += weights[k] * d_color[c];
  }
  d_uv[0] += d_a * T(static_cast<float>(texture.width));
  d_uv[1] -= d_b * T(static_cast<float>(texture.height));
}

}  // namespace tilegrad::shade
