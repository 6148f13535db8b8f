// SPDX-License-Identifier: Apache-2.0
// Texture coordinates for a mesh of any shape: charts, each projected along an axis and packed into
// one texture.
#pragma once

#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad {

struct UnwrapOptions {
  int width = 512, height = 512;  // texels; 16 or more
  int gutter = 2;                 // padding around each chart, texels
};

// A face may join a chart if its normal is within the angle of this cosine of the chart's axis (one
// of +-x, +-y, +-z).
inline constexpr double kLeastCosine = 0.25;

// Sets mesh->corner_uvs. Connected faces projected along the same axis form a chart, as long as
// none overlaps another: no texel centre is in two faces. Smooths the axis labels first, so that a
// rough surface does not fall apart. Charts keep their proportions, are scaled as large as fits,
// and packed on shelves by height (first fit). A pure function. Errors: sizes out of range; more
// charts than fit into the texture.
Status Unwrap(const UnwrapOptions& options, Mesh* mesh);

}  // namespace tilegrad
