// SPDX-License-Identifier: Apache-2.0
// The truth of lambert.h. T: float, double, std::complex<double>.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <span>

#include "shade/lambert.h"

namespace tilegrad::shade {
namespace lambert_ref {

template <class T>
bool Positive(T x) {
  return x > T(0);
}
template <class T>
bool Positive(std::complex<T> x) {
  return x.real() > T(0);
}

template <class T>
T Dot(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace lambert_ref

// I_l for the unit normal n.
template <class T>
T LambertRef(const LambertLightT<T>& light, const std::array<T, 3>& n) {
  T sum = light.ambient;
  for (const auto& l : light.lights) {
    const T cosine = lambert_ref::Dot(n, l.direction);
    if (lambert_ref::Positive(cosine)) sum += l.intensity * cosine;
  }
  return sum;
}

// Adds what d_light = dL/d(I_l) pulls back to d_n, and to d_lights (as light.lights; may be empty).
// dL/d(ambient) is d_light itself. A light exactly at the horizon gives nothing.
template <class T>
void LambertAdjointRef(const LambertLightT<T>& light, const std::array<T, 3>& n, T d_light,
                       std::array<T, 3>& d_n, std::span<DirectionalLightT<T>> d_lights) {
  for (std::size_t k = 0; k < light.lights.size(); ++k) {
    const auto& l = light.lights[k];
    const T cosine = lambert_ref::Dot(n, l.direction);
    if (!lambert_ref::Positive(cosine)) continue;
    for (std::size_t i = 0; i < 3; ++i) d_n[i] += d_light * l.intensity * l.direction[i];
    if (d_lights.empty()) continue;
    d_lights[k].intensity += d_light * cosine;
    for (std::size_t i = 0; i < 3; ++i) d_lights[k].direction[i] += d_light * l.intensity * n[i];
  }
}

}  // namespace tilegrad::shade
