// SPDX-License-Identifier: Apache-2.0
// Texture coordinates for a template sphere.
#pragma once

#include "scene/mesh.h"

namespace tilegrad {

// Longitude and latitude of each corner, [3F]: u = 1/2 + atan2(-z, x) / 2 pi goes once around the y
// axis, v from the lower pole (0) to the upper (1). `sphere` is centred on the origin. Faces that
// cross the seam run beyond u = 1, where the texture repeats; a corner at a pole has the mean u of
// the other two, so no face runs backwards through the map. The mirror image at x = 0 of a point at
// u is at 1/2 - u.
std::vector<glm::vec2> SphereUvs(const Mesh& sphere);

}  // namespace tilegrad
