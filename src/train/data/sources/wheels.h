// SPDX-License-Identifier: Apache-2.0
// Wheels of cars whose models have none.
#pragma once

#include <string_view>
#include <vector>

#include "base/error.h"
#include "scene/mesh.h"

namespace tilegrad::train {

struct Wheel {
  glm::vec3 centre;  // in the file's frame and units
  float radius = 0, width = 0;
};

// "x y z radius width", several separated by '|'.
Result<std::vector<Wheel>> ReadWheels(std::string_view text);

// Adds a tyre of dark grey with a rim of light grey on either side; `axle` is the axis of the file
// that it turns about, of length 1.
void AddWheel(const Wheel& wheel, glm::vec3 axle, Mesh* mesh);

}  // namespace tilegrad::train
