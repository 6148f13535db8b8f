// SPDX-License-Identifier: Apache-2.0
// Keypoints of rendered models, which have no annotations: the vertices that reach farthest in
// fixed directions, in coordinates scaled by the half extents of the bounding box.
#pragma once

#include <array>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad::train {

struct ExtremePoint {
  const char* name;
  std::array<float, 3> direction;  // x to the left, y up, z to the front
};

// Six pairs, left then right, at about the places of PASCAL3D+'s twelve of cars: bumpers, lights,
// trunk, and the four corners of the roof.
extern const std::array<ExtremePoint, 12> kExtremePoints;
std::vector<int> ExtremeMirror();  // keypoint i is the mirror image of keypoint [i]

// For a mesh with vertices: the mean of the vertices that reach farthest, within a hundredth.
std::vector<glm::vec3> FindExtremePoints(const Mesh& mesh);

}  // namespace tilegrad::train
