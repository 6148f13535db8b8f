// SPDX-License-Identifier: Apache-2.0
// Scalar reference of lambert.h. T: float, double, std::complex<double>.
#pragma once

#include "base/scalar.h"
#include "shade/lambert.h"
#include "shade/vec3_ref.h"

namespace tilegrad::shade {

// For the unit normal n; starts from `ambient`.
template <class T>
T LambertRef(const LambertLightT<T>& light, const Vec3<T>& n) {
  T sum = light.ambient;
  for (const auto& l : light.lights) {
    const T cosine = Dot(n, l.direction);
    if (RealPart(cosine) >= 0) sum += l.intensity * cosine;
  }
  return sum;
}

// Adds the gradients due to d_light = dL/d(light) to d_n and d_lights (as light.lights; may be
// empty). dL/d(ambient) is d_light itself.
template <class T>
void LambertAdjointRef(const LambertLightT<T>& light, const Vec3<T>& n, T d_light, Vec3<T>& d_n,
                       std::span<LightT<T>> d_lights) {
  for (std::size_t k = 0; k < light.lights.size(); ++k) {
    const auto& l = light.lights[k];
    const T cosine = Dot(n, l.direction);
    if (!(RealPart(cosine) >= 0)) continue;
    AddScaled(d_light * l.intensity, l.direction, d_n);
    if (d_lights.empty()) continue;
    d_lights[k].intensity += d_light * cosine;
    AddScaled(d_light * l.intensity, n, d_lights[k].direction);
  }
}

}  // namespace tilegrad::shade
