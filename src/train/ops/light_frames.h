// SPDX-License-Identifier: Apache-2.0
// Light in the axes of cameras, as networks see it, turned to the world's, as the renderer takes
// it.
#pragma once

#include <span>

#include "nn/tape.h"
#include "tilegrad/camera.h"

namespace tilegrad::train {

// [N,3] -> [N,3]: R^T d with the rotation R of each image's camera.
nn::Var DirectionsToWorld(const nn::Var& directions, std::span<const Camera> cameras);
// [N,9] -> [N,9], as scene/light_frame.h.
nn::Var HarmonicsToWorld(const nn::Var& sh, std::span<const Camera> cameras);

}  // namespace tilegrad::train
