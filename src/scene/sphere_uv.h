// SPDX-License-Identifier: Apache-2.0
// Texture coordinates for a template sphere.
#pragma once

#include <array>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad {

// Longitude and latitude of each corner, [3F]: u = 1/2 + atan2(-z, x) / 2 pi goes once around the y
// axis, v from the lower pole (0) to the upper (1). `sphere` is centred on the origin. Faces that
// cross the seam run beyond u = 1, where the texture repeats; a corner at a pole has the mean u of
// the other two, so no face runs backwards through the map. The mirror image at x = 0 of a point at
// u is at 1/2 - u.
std::vector<glm::vec2> SphereUvs(const Mesh& sphere);

// A point of a mesh: its face, that one's vertices, and weights that sum to 1.
struct SurfacePoint {
  std::int32_t face;
  Face vertices;
  std::array<float, 3> weights;
};

// The point of `sphere` behind each texel of such a map, [height][width]: where the ray from the
// origin in the direction of the texel's centre leaves it. `sphere` is convex around the origin and
// its faces run counter-clockwise, seen from outside.
std::vector<SurfacePoint> SphereTexels(const Mesh& sphere, int width, int height);

}  // namespace tilegrad
