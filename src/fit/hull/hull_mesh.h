// SPDX-License-Identifier: Apache-2.0
// The visual hull (A. Laurentini 1994): the largest thing that the masks allow, carved out of a
// grid; and its surface as a mesh to start a fit from.
#pragma once

#include <cmath>

#include "base/parallel.h"
#include "fit/input.h"
#include "scene/level_set.h"
#include "scene/mesh.h"

namespace tilegrad::train {

struct CarveOptions {
  double cell_pixels = 0.7;  // a cell's side, in pixels of an image where the object is
  int most_cells = 320;      // along the longest side; fewer where images are small
  // Pixels that masks are widened by, so that what is thin is not cut by one view that shows it
  // half a pixel off.
  double margin_pixels = 0.25;
  // How many views may see a point outside of their mask that is kept all the same, as a share of
  // the views: for masks that lack something. Each makes the rest less sharp.
  double tolerance = 0;
};

// About how far inside of the hull the grid's points are, world units: of the distances to the
// outlines, each in one view, the least (or the one after those that `tolerance` forgives). Near
// the surface only; elsewhere the sign counts. What a camera does not have before it is outside.
// The grid surrounds the hull. Any number of workers gives the same bits. An error if no point is
// inside, that says so; or kCancelled.
Result<ScalarGrid> Carve(const FitInput& input, const CarveOptions& options, const Workers& workers,
                         const Watch& watch = {});

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
