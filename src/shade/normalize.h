// SPDX-License-Identifier: Apache-2.0
// Normalises a vector per pixel: x / |x|, and its adjoint.
//
// A vector whose squared length is at most `least` becomes 0 without gradient, so that a normal
// cancelled by interpolation gives no NaN.
#pragma once

#include <cstddef>

#include "shade/pixel_run.h"

namespace tilegrad::shade {

// For interpolated unit vectors; rounding alone leaves about 1e-14.
inline constexpr float kLeastUnitSquare = 1e-12f;
// For vectors in world units.
inline constexpr float kLeastWorldSquare = 1e-30f;
// For the largest component of vectors of any scale: normals of tiny faces, lights.
inline constexpr float kLeastComponent = 1e-30f;

// unit[3], *inverse_length <- x[3]. `unit` may be `x`.
void Normalize(std::size_t count, const RunPlane* x, float least, RunPlane* unit,
               RunPlane* inverse_length);

// d_x[3] <- inverse_length * (d_unit - unit (unit . d_unit)). `d_x` may be `d_unit`.
void NormalizeAdjoint(std::size_t count, const RunPlane* unit, const RunPlane& inverse_length,
                      const RunPlane* d_unit, RunPlane* d_x);

}  // namespace tilegrad::shade
