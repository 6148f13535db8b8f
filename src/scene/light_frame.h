// SPDX-License-Identifier: Apache-2.0
// Light in the axes of a camera, turned to those of the world, as the renderer takes it.
#pragma once

#include <array>

#include "tilegrad/camera.h"

namespace tilegrad {

// R^T d with the camera's rotation R.
std::array<float, 3> DirectionToWorld(const std::array<float, 3>& direction, const Camera& camera);
// Coefficients of SceneT::sh: at any world direction n the light that the given ones have at R n.
// Exact: degree 2 is closed under rotation.
std::array<double, 9> HarmonicsToWorld(const std::array<double, 9>& sh, const Camera& camera);
std::array<float, 9> HarmonicsToWorld(const std::array<float, 9>& sh, const Camera& camera);

}  // namespace tilegrad
