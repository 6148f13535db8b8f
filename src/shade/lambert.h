// SPDX-License-Identifier: Apache-2.0
// Lambertian light (equation 10; the first term of equation 8): sum over lights of
// intensity * max(0, N . L). combine.h applies it to surfaces.
#pragma once

#include <cstddef>
#include <span>

#include "shade/pixel_run.h"
#include "tilegrad/scene.h"

namespace tilegrad::shade {

// The zero gradient of a light, to add to.
template <class T>
constexpr LightT<T> kNoLight = {{T(0), T(0), T(0)}, T(0)};

template <class T>
struct LambertLightT {
  T ambient = T(0);
  std::span<const LightT<T>> lights;  // unit directions
};

// The lights of a run of pixels: shared by all, or one direction per pixel, of intensity 1.
struct RunLights {
  std::span<const Light> uniform;       // unit directions
  const RunPlane* per_pixel = nullptr;  // [3] unit; then `uniform` is empty
};

// Destinations of gradients of lights and normals. Null or empty: not requested.
struct RunLightAdjoint {
  RunPlane* d_normal = nullptr;       // [3] adds
  std::span<LightT<double>> uniform;  // adds; as RunLights::uniform, or empty
  RunPlane* per_pixel = nullptr;      // [3] adds
};

// *light <- the sum above, for the unit normals [3] of a run. A zero normal gets no light.
void Lambert(std::size_t count, const RunPlane* normal, const RunLights& lights, RunPlane* light);

// d_light: cotangent of the sum. A light behind the surface gets no gradient; one exactly at the
// horizon counts as in front.
void LambertAdjoint(std::size_t count, const RunPlane* normal, const RunLights& lights,
                    const RunPlane& d_light, const RunLightAdjoint& out);

}  // namespace tilegrad::shade
