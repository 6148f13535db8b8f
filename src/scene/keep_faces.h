// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "scene/mesh.h"

namespace tilegrad {

// Leaves the faces whose entry of `keep` (one for each face) is not 0, with what their corners
// have. Vertices, materials and textures stay. Returns false and changes nothing if none is to be
// kept.
bool KeepFaces(const std::vector<char>& keep, Mesh* mesh);

}  // namespace tilegrad
