// SPDX-License-Identifier: Apache-2.0
// Fewer faces for the same surface.
#pragma once

#include <functional>

#include "scene/edit_mesh.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad {

struct SimplifyLimits {
  // How far a patch of the surface of `patch` may move, world units; larger ones less, smaller ones
  // more, as volume goes.
  float error = 0, patch = 1;
  float longest = 1e30f;  // edge that a collapse may make; world units
  std::size_t most_faces =
      0;  // as long as there are more, `error` does not stop; 0: it always does
  // Now and then asked how it goes, by the faces that are left; an error ends the work.
  std::function<Status(std::size_t faces)> told = nullptr;
};

// Collapses edges, the one of the least quadric error first (Garland, Heckbert 1997), and keeps the
// surface a closed manifold of the same topology; no face turns over. Positions and faces only. An
// error if `mesh` is not a closed manifold (scene/edit_mesh.h).
Result<Mesh> Simplified(const Mesh& mesh, const SimplifyLimits& limits);

}  // namespace tilegrad
