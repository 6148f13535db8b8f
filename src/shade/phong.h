// SPDX-License-Identifier: Apache-2.0
// The highlight of the Phong model (the second term of equation 8), without its factor k_s: sum
// over lights of intensity * r^shininess.
//
//   c = clamp(N . L, 0, 1)      R = -L + 2 c N      r = clamp(R . V, 1e-5, 1)
//
// with V the unit direction to the eye. As in the paper's implementations, R is -L where the
// surface faces away from the light, which keeps the highlight continuous there, and the floor on r
// keeps the derivative of the power finite.
#pragma once

#include <cstddef>

#include "shade/lambert.h"
#include "shade/pixel_run.h"

namespace tilegrad::shade {

inline constexpr float kLeastReflection = 1e-5f;

struct PhongInput {
  const RunPlane* normal;  // [3] unit, or 0
  const RunPlane* eye;     // [3] unit, or 0
  RunLights lights;
  float shininess;  // >= 0
};

struct PhongAdjoint {
  RunLightAdjoint light;
  RunPlane* d_eye = nullptr;      // [3] adds
  double* d_shininess = nullptr;  // adds
};

void Phong(std::size_t count, const PhongInput& input, RunPlane* highlight);

// A clamped value has no gradient, except exactly at the ends of its range.
void PhongAdjointOf(std::size_t count, const PhongInput& input, const RunPlane& d_highlight,
                    const PhongAdjoint& out);

}  // namespace tilegrad::shade
