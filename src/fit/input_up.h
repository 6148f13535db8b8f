// SPDX-License-Identifier: Apache-2.0
// Which way is up in the world of an input.
#pragma once

#include "fit/input.h"

namespace tilegrad::train {

// The axis that all cameras stand upright about; none where that is not plain, or is y.
std::optional<UpAxis> GuessUp(std::span<const Camera> cameras);

// Turns cameras that are given in a world with another axis up, so that meshes made with them have
// Turns the world y up, as in glTF, from `up` or, if that is not given, from GuessUp, with a
// warning. In COLMAP's own world, up is the mean up of the cameras (UpOf).
void TurnInputUpright(std::optional<UpAxis> up, FitInput* input);

}  // namespace tilegrad::train
