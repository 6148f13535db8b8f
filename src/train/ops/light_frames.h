// SPDX-License-Identifier: Apache-2.0
// Light in the axes of cameras, as networks see it, turned to the world's, as the renderer takes
// it.
#pragma once

#include <array>
#include <span>

#include "nn/tape.h"
#include "tilegrad/camera.h"

namespace tilegrad::train {

// [N,3] -> [N,3]: R^T d with the rotation R of each image's camera.
nn::Var DirectionsToWorld(const nn::Var& directions, std::span<const Camera> cameras);
// [N,9] -> [N,9] of SceneT::sh: at any world direction n the light that the given harmonics have at
// R n. Exact: degree 2 is closed under rotation.
nn::Var HarmonicsToWorld(const nn::Var& sh, std::span<const Camera> cameras);

// The same of one camera.
std::array<float, 3> DirectionToWorld(const std::array<float, 3>& direction, const Camera& camera);
std::array<float, 9> HarmonicsToWorld(const std::array<float, 9>& sh, const Camera& camera);

}  // namespace tilegrad::train
