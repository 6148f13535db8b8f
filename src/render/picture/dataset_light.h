// SPDX-License-Identifier: Apache-2.0
// The light of datasets: Lambert with ambient 0.45, a key light of 0.45 from (0.35, 0.8, 0.5) and a
// fill light of 0.2 from (-0.6, 0.3, -0.75), fixed in the world, in the numbers of the files.
#pragma once

#include <array>

#include "tilegrad/scene.h"

namespace tilegrad {

inline constexpr float kDatasetAmbient = 0.45f;

std::array<Light, 2> DatasetLights();  // key, fill; directions are unit

// White, with that ambient light.
Surface DatasetSurface();

}  // namespace tilegrad
