// SPDX-License-Identifier: Apache-2.0
// The spherical harmonics of lighting; rotates light from camera axes to the world axes that the
// renderer takes.
#pragma once

#include <array>

#include "tilegrad/camera.h"

namespace tilegrad {

// The real, orthonormal spherical harmonics of degree 0 to 2, for the coefficients in SceneT::sh,
// in one direction. The renderer uses the polynomials of src/shade/spherical_harmonics_ref.h.
inline constexpr double kHarmonic0 = 0.28209479177387814;  // sqrt(1 / 4 pi)
inline constexpr double kHarmonic1 = 0.48860251190291992;  // sqrt(3 / 4 pi)

// `d`: unit.
inline std::array<double, 9> HarmonicBasis(const std::array<double, 3>& d) {
  constexpr double k2 = 1.0925484305920792, k3 = 0.31539156525252005;  // sqrt(15, 5/4 / 4 pi)
  const auto& [x, y, z] = d;
  return {kHarmonic0,  -kHarmonic1 * y,      kHarmonic1 * z, -kHarmonic1 * x,         k2 * x * y,
          -k2 * y * z, k3 * (3 * z * z - 1), -k2 * x * z,    k2 / 2 * (x * x - y * y)};
}

// R^T d with the camera's rotation R.
std::array<float, 3> DirectionToWorld(const std::array<float, 3>& direction, const Camera& camera);
// Rotates SceneT::sh: the result gives in world direction n the light that `sh` gives in direction
// R n. Exact: degree 2 is closed under rotation.
std::array<double, 9> HarmonicsToWorld(const std::array<double, 9>& sh, const Camera& camera);
std::array<float, 9> HarmonicsToWorld(const std::array<float, 9>& sh, const Camera& camera);

}  // namespace tilegrad
