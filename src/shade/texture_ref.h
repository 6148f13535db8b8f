// SPDX-License-Identifier: Apache-2.0
// Scalar reference of texture.h. T: float, double, std::complex<double> (coordinates and texels
// carry a complex step; the choice of texels follows the real part).
#pragma once

#include <algorithm>
#include <cmath>

#include "base/scalar.h"
#include "shade/texture.h"

namespace tilegrad::shade {
namespace texture_ref {

// One axis of the filter: texels `low` and `high`, weight of `high`, d(weight)/d(coordinate).
template <class T>
struct Axis {
  int low, high;
  T weight;
  float slope;
};

// A coordinate wrapped to the texture, and its derivative: [0, 1], or [-1, 2] if clamped.
template <class T>
struct Wrapped {
  T at;
  float slope;
};

template <class T>
Wrapped<T> WrapCoordinate(const T& u, Wrap wrap) {
  const auto real = RealPart(u);
  using Real = std::decay_t<decltype(real)>;
  if (!std::isfinite(real)) return {T(0), 0};
  if (wrap == Wrap::kClamp) {
    if (real < -1) return {T(-1), 0};
    return real > 2 ? Wrapped<T>{T(2), 0} : Wrapped<T>{u, 1};
  }
  if (wrap != Wrap::kMirror) return {u - T(std::floor(real)), 1};
  const T two = u - T(Real(2) * std::floor(real * Real(0.5)));
  return RealPart(two) > 1 ? Wrapped<T>{T(2) - two, -1} : Wrapped<T>{two, 1};
}

inline int WrapIndex(int i, int n, Wrap wrap) {
  if (wrap != Wrap::kRepeat) return std::clamp(i, 0, n - 1);
  return i < 0 ? n - 1 : i < n ? i : 0;  // wrapped coordinates are at most one texel outside
}

// Along u, wrapped with mode `way`; for v, call it with 1 - v.
template <class T>
Axis<T> MakeAxis(const Wrapped<T>& u, int n, Wrap way, const TextureViewT<T>& texture) {
  const bool nearest = texture.filter == Filter::kNearest;
  const auto scale = static_cast<float>(n);
  const T x = nearest ? u.at * T(scale) : u.at * T(scale) - T(0.5f);
  const auto cell = std::floor(RealPart(x));
  const int i = static_cast<int>(cell);
  if (nearest) {
    const int texel = std::clamp(i, 0, n - 1);
    return {texel, texel, T(0), 0};
  }
  return {WrapIndex(i, n, way), WrapIndex(i + 1, n, way), x - T(cell), u.slope * scale};
}

template <class T>
struct Footprint {
  Axis<T> column, row;
  std::size_t texel[4];  // offsets of the upper left, upper right, lower left, lower right texel
};

template <class T>
Footprint<T> MakeFootprint(const TextureViewT<T>& texture, const T& u, const T& v) {
  const Wrap along_u = WrapAlongU(texture.wrap), along_v = WrapAlongV(texture.wrap);
  Wrapped<T> down = WrapCoordinate(v, along_v);
  down = {T(1) - down.at, -down.slope};
  Footprint<T> out{MakeAxis(WrapCoordinate(u, along_u), texture.width, along_u, texture),
                   MakeAxis(down, texture.height, along_v, texture),
                   {}};
  const int rows[2] = {out.row.low, out.row.high}, columns[2] = {out.column.low, out.column.high};
  for (int k = 0; k < 4; ++k) {
    const auto texel = static_cast<std::size_t>(rows[k / 2]) * texture.width + columns[k % 2];
    out.texel[k] = texel * static_cast<std::size_t>(texture.channels);
  }
  return out;
}

}  // namespace texture_ref

// color[channels] <- the nearest texel or the bilinear value at (u, v), of this level alone.
template <class T>
void SampleLevelRef(const TextureViewT<T>& texture, const T& u, const T& v, std::span<T> color) {
  const auto at = texture_ref::MakeFootprint(texture, u, v);
  const T a = at.column.weight, b = at.row.weight;
  for (std::size_t c = 0; c < static_cast<std::size_t>(texture.channels); ++c) {
    const T* t = texture.texels.data() + c;
    const T top = t[at.texel[0]] + a * (t[at.texel[1]] - t[at.texel[0]]);
    const T bottom = t[at.texel[2]] + a * (t[at.texel[3]] - t[at.texel[2]]);
    color[c] = top + b * (bottom - top);
  }
}

// Adds the gradients due to d_color[channels] to d_uv[2] and d_texels (shaped as texture.texels;
// may be empty).
template <class T>
void SampleLevelAdjointRef(const TextureViewT<T>& texture, const T& u, const T& v,
                           std::span<const T> d_color, std::span<T> d_uv, std::span<T> d_texels) {
  const auto at = texture_ref::MakeFootprint(texture, u, v);
  const T a = at.column.weight, b = at.row.weight;
  const T weights[4] = {(T(1) - a) * (T(1) - b), a * (T(1) - b), (T(1) - a) * b, a * b};
  T d_a = T(0), d_b = T(0);
  for (std::size_t c = 0; c < static_cast<std::size_t>(texture.channels); ++c) {
    const T* t = texture.texels.data() + c;
    const T t0 = t[at.texel[0]], t1 = t[at.texel[1]], t2 = t[at.texel[2]], t3 = t[at.texel[3]];
    d_a += d_color[c] * ((T(1) - b) * (t1 - t0) + b * (t3 - t2));
    d_b += d_color[c] * ((T(1) - a) * (t2 - t0) + a * (t3 - t1));
    if (d_texels.empty()) continue;
    for (int k = 0; k < 4; ++k) d_texels[at.texel[k] + c] += weights[k] * d_color[c];
  }
  d_uv[0] += d_a * T(at.column.slope);
  d_uv[1] += d_b * T(at.row.slope);
}

}  // namespace tilegrad::shade
