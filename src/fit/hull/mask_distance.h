// SPDX-License-Identifier: Apache-2.0
// How far a pixel is from the outline of a mask.
#pragma once

#include <span>
#include <vector>

namespace tilegrad::train {

// Of one image: [height][width], pixels, positive inside.
struct MaskDistance {
  int width = 0, height = 0;
  std::vector<float> values;

  // Bilinear, at a place in pixels from the image's upper left corner. Beyond the border it is what
  // stands at the border, less the distance from there if that is outside of the mask: whether an
  // object that the border cuts goes on is not known. A place that is not finite is infinitely far
  // outside.
  float At(float x, float y) const;
};

// `alpha` [height][width]: the outline is where it is 0.5, between pixels' centres linearly, so
// that soft borders of masks count. Distances are those to the nearest of the outline's points that
// two passes of Danielsson's propagation find (Computer Graphics and Image Processing, 1980), which
// is the nearest of all up to a fraction of a pixel. A mask without an outline has +-1e6
// everywhere.
MaskDistance DistanceOf(std::span<const float> alpha, int width, int height);

}  // namespace tilegrad::train
