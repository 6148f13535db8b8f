// SPDX-License-Identifier: Apache-2.0
// Scalar reference of combine.h. T: float, double, std::complex<double>.
#pragma once

#include "base/scalar.h"
#include "shade/combine.h"
#include "shade/vec3_ref.h"

namespace tilegrad::shade {

// The parts of one pixel.
template <class T>
struct ColorParts {
  Vec3<T> texture = {T(1), T(1), T(1)}, vertex_color = {T(1), T(1), T(1)};
  T light = T(0), highlight = T(0);
};

// Of one channel, before the clamp.
template <class T>
T CombineChannelRef(const ColorFactorsT<T>& f, const ColorParts<T>& p, bool lit, std::size_t c) {
  const T surface = f.base[c] * p.texture[c] * p.vertex_color[c];
  const T light = lit ? f.ambient[c] + f.diffuse[c] * p.light : T(1);
  return light * surface + f.specular[c] * p.highlight;
}

template <class T>
bool InUnitRange(const T& x) {
  return RealPart(x) >= 0 && RealPart(x) <= 1;
}

// p.highlight must be 0 if nothing is lit.
template <class T>
Vec3<T> CombineRef(const ColorFactorsT<T>& f, const ColorParts<T>& p, bool lit, bool clamp) {
  Vec3<T> out;
  for (std::size_t c = 0; c < 3; ++c) {
    out[c] = CombineChannelRef(f, p, lit, c);
    if (clamp && !InUnitRange(out[c])) out[c] = RealPart(out[c]) > 1 ? T(1) : T(0);
  }
  return out;
}

// Adds to d_f and d_p.
template <class T>
void CombineAdjointRef(const ColorFactorsT<T>& f, const ColorParts<T>& p, bool lit, bool clamp,
                       const Vec3<T>& d_color, ColorFactorsT<T>& d_f, ColorParts<T>& d_p) {
  for (std::size_t c = 0; c < 3; ++c) {
    if (clamp && !InUnitRange(CombineChannelRef(f, p, lit, c))) continue;
    const T d = d_color[c];
    const T light = lit ? f.ambient[c] + f.diffuse[c] * p.light : T(1);
    const T d_surface = d * light;
    d_f.base[c] += d_surface * p.texture[c] * p.vertex_color[c];
    d_p.texture[c] += d_surface * f.base[c] * p.vertex_color[c];
    d_p.vertex_color[c] += d_surface * f.base[c] * p.texture[c];
    d_f.specular[c] += d * p.highlight;
    d_p.highlight += d * f.specular[c];
    if (!lit) continue;
    const T d_light = d * f.base[c] * p.texture[c] * p.vertex_color[c];
    d_f.ambient[c] += d_light;
    d_f.diffuse[c] += d_light * p.light;
    d_p.light += d_light * f.diffuse[c];
  }
}

}  // namespace tilegrad::shade
