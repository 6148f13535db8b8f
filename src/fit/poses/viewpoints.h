// SPDX-License-Identifier: Apache-2.0
// An object from all around, and where a picture fits in best.
#pragma once

#include <array>
#include <vector>

#include "fit/poses/crop.h"
#include "fit/scene.h"

namespace tilegrad::train {

struct Viewpoint {
  Camera camera;  // looks at the origin
  Crop crop;      // what it sees
};

// The object of a scene, which is about 1 across and around the origin, from 12.5 to 15 degrees
// apart: from 45 degrees below the horizon to 80 above, without roll about `up`.
Result<std::vector<Viewpoint>> LookAround(const FitScene& scene, const std::array<double, 3>& up,
                                          FitRenderer* renderer);

// Degrees between the directions in which two cameras look.
double DirectionGap(const Camera& a, const Camera& b);

}  // namespace tilegrad::train
