// SPDX-License-Identifier: Apache-2.0
// The surface of the visual hull as a mesh to start a fit from.
#pragma once

#include <cmath>

#include "fit/hull/carve.h"
#include "scene/mesh.h"

namespace tilegrad::train {

struct HullOptions {
  CarveOptions carve;
  // Pixels of an image where the object is: how far the surface may move to have fewer faces, and
  // the longest edge.
  double error_pixels = 0.25, longest_pixels = 16;
  double patch_pixels = 1.5;  // side of the patch that may move as far (scene/simplify.h)
  // `error_pixels` yields to it; a surface too ragged for so few is carved anew with larger cells.
  std::size_t most_faces = 40'000;
};

// What a fit needs to know of a hull.
struct HullTraits {
  bool hollow = false;  // less hollows that colours show (hollows.h)
  // Mean thickness in pixels of an image where the object is: twice the volume by the area.
  double thickness = HUGE_VAL;
};

// A closed manifold of any genus and number of parts, but for specks of less than a few cells; the
// hull less the hollows that colours show (hollows.h). Writes `traits`, if given. Errors: as Carve.
Result<Mesh> HullMesh(const FitInput& input, const HullOptions& options, const Workers& workers,
                      const Watch& watch = {}, HullTraits* traits = nullptr);

}  // namespace tilegrad::train
