// SPDX-License-Identifier: Apache-2.0
// Which way is up in the world of an input.
#pragma once

#include "fit/input.h"

namespace tilegrad::train {

// The axis that all cameras stand upright about; none where that is not plain, or is y.
std::optional<UpAxis> GuessUp(std::span<const Camera> cameras);

// Turns cameras that are given in a world with another axis up, so that meshes made with them have
// y up, as glTF wants it: `up`, or where there is none what GuessUp finds, which a warning says. In
// a world of its own, up is what it is for people who hold their cameras level (UpOf).
void TurnInputUpright(std::optional<UpAxis> up, FitInput* input);

}  // namespace tilegrad::train
