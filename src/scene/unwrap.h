// SPDX-License-Identifier: Apache-2.0
// Texture coordinates for a mesh of any shape: charts, each seen along an axis, and their places in
// one texture.
#pragma once

#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad {

struct UnwrapOptions {
  int width = 512, height = 512;  // texels; 16 or more
  int gutter = 2;                 // texels of each chart's own around it
};

// Faces lie in a chart whose axis (one of +-x, +-y, +-z) is within the angle of this cosine of
// their normal.
inline constexpr double kLeastCosine = 0.25;

// Sets mesh->corner_uvs. Faces that look along the same axis and hang together make a chart, as
// long as none lies over another: no texel's centre is in two faces. Labels are smoothed first, so
// that a rough surface does not fall apart. Charts keep their proportions, and are as large as
// fits, on shelves by height (first fit). A pure function. An error: sizes out of range; more
// charts than the texture has room for.
Status Unwrap(const UnwrapOptions& options, Mesh* mesh);

}  // namespace tilegrad
