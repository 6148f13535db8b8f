// SPDX-License-Identifier: Apache-2.0
// Faces divided in four at the middles of their edges.
#pragma once

#include "base/function_ref.h"
#include "scene/mesh.h"

namespace tilegrad {

// `middle(a, b)` makes the vertex between a < b, once for each edge in order of first use, and
// returns its index. Face (a, b, c) becomes those at a, b and c, then the one in the middle.
std::vector<Face> SplitFaces(const std::vector<Face>& faces,
                             FunctionRef<std::int32_t(std::int32_t a, std::int32_t b)> middle);

// `mesh` with every face divided; new positions, vertex colours and texture coordinates are the
// means of their edge's ends. A single material and its textures stay; other arrays are left out.
Mesh Subdivided(const Mesh& mesh);

}  // namespace tilegrad
