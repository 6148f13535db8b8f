// SPDX-License-Identifier: Apache-2.0
// Which faces share an edge, by the indices of its two vertices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compat/nvdiffrast/clip_mesh.h"

namespace tilegrad::compat::nvdiffrast {

// Side 3 f + k of face f goes from its corner k to the next one, and is opposite to the third. The
// sides of one edge form a ring: next[side] is another side of the same edge, or the side itself at
// a boundary. However many faces share the edge, all of them are in its ring.
struct EdgeRings {
  std::vector<std::int32_t> next;  // [3 F]
};

EdgeRings BuildEdgeRings(FaceList faces);

}  // namespace tilegrad::compat::nvdiffrast
