// SPDX-License-Identifier: Apache-2.0
// Default cameras that see a whole mesh.
#pragma once

#include <span>
#include <vector>

#include "scene/camera.h"
#include "scene/mesh.h"

namespace tilegrad {

// Degrees; as OrbitCamera's: azimuth 90 stands on +z, elevation 90 above.
struct ViewAngle {
  double azimuth = 60, elevation = 20;
};

struct Framing {
  Lens lens;
  double margin = 0.05;  // share of the half image left free on each side, [0, 1)
  double distance = 0;   // of the eye from the middle, world units; 0: as near as all views allow
};

// Cameras that look at the middle of the mesh's bounding box, all from one distance. With the
// default distance every used vertex is inside of every image. `mesh` is valid and has a face. An
// error if it has no extent, or for a lens or margin out of range.
Result<std::vector<Camera>> FrameMesh(const Mesh& mesh, const Framing& framing,
                                      std::span<const ViewAngle> views);

}  // namespace tilegrad
