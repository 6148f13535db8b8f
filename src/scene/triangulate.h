// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad {

// Splits a simple polygon, convex or not, planar or nearly so, into n - 2 triangles with the
// polygon's orientation, by clipping ears. Sets `triangles` to indices into `corners`; fewer than
// three corners give none. A convex polygon becomes the fan about its corner 0, and so does what
// has no ear left (a polygon that crosses itself or has no area) and one of more than 256 corners,
// since the search for ears takes cubic time at worst.
void TriangulatePolygon(std::span<const glm::vec3> corners, std::vector<Face>& triangles);

}  // namespace tilegrad
