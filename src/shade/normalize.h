// SPDX-License-Identifier: Apache-2.0
// Directions of pixels: x / |x|, and its adjoint.
//
// A vector whose squared length is at or below `least` has no direction: it becomes 0 without a
// gradient, so that a normal cancelled by interpolation yields no NaN.
#pragma once

#include <cstddef>

#include "shade/pixel_run.h"

namespace tilegrad::shade {

// Of interpolated unit vectors; rounding alone leaves about 1e-14.
inline constexpr float kLeastUnitSquare = 1e-12f;
// Of vectors in units of the world.
inline constexpr float kLeastWorldSquare = 1e-30f;
// Of the largest component, where vectors may have any scale: normals of tiny faces, lights.
inline constexpr float kLeastComponent = 1e-30f;

// unit[3], *inverse_length <- x[3]. `unit` may be `x`.
void Normalize(std::size_t count, const RunPlane* x, float least, RunPlane* unit,
               RunPlane* inverse_length);

// d_x[3] <- inverse_length * (d_unit - unit (unit . d_unit)). `d_x` may be `d_unit`.
void NormalizeAdjoint(std::size_t count, const RunPlane* unit, const RunPlane& inverse_length,
                      const RunPlane* d_unit, RunPlane* d_x);

}  // namespace tilegrad::shade
