// SPDX-License-Identifier: Apache-2.0
// Lambertian light (equation 7 without its specular term): I_l = ambient + sum over lights of
// intensity * max(0, n . l); the shaded colour is I_l times the surface's own.
#pragma once

#include <array>
#include <span>

namespace tilegrad::shade {

template <class T>
struct DirectionalLightT {
  std::array<T, 3> direction;  // unit, from the surface towards the light
  T intensity;
};

template <class T>
struct LambertLightT {
  T ambient = T(0);
  std::span<const DirectionalLightT<T>> lights;
};

}  // namespace tilegrad::shade
