// SPDX-License-Identifier: Apache-2.0
// Spherical-harmonics lighting up to degree 2 (equation 11): I_l = sum_i w_i Y_i(N), nine
// coefficients. The Y_i are the orthonormal real basis with the Condon-Shortley sign: 1, -y, z, -x,
// xy, -yz, 3z^2-1, -xz, x^2-y^2 times constants. (R. Ramamoorthi, P. Hanrahan: An efficient
// representation for irradiance environment maps, 2001.)
#pragma once

#include <array>
#include <cstddef>

#include "shade/pixel_run.h"

namespace tilegrad::shade {

// I_l as a polynomial in N = (x, y, z): p[0] + p[1] x + p[2] y + p[3] z + p[4] xy + p[5] yz
// + p[6] z^2 + p[7] xz + p[8] (x^2 - y^2).
template <class T>
using ShPolynomialT = std::array<T, 9>;
using ShPolynomial = ShPolynomialT<float>;

// *light <- the polynomial at the unit normals [3] of a run. 0 where the normal is 0.
void ShLight(std::size_t count, const RunPlane* normal, const ShPolynomial& polynomial,
             RunPlane* light);

// Adds to d_normal[3] and d_polynomial; null: not requested.
void ShLightAdjoint(std::size_t count, const RunPlane* normal, const ShPolynomial& polynomial,
                    const RunPlane& d_light, RunPlane* d_normal,
                    ShPolynomialT<double>* d_polynomial);

}  // namespace tilegrad::shade
