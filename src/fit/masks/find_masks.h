// SPDX-License-Identifier: Apache-2.0
// Masks of pictures that came without, where cameras are known: the object is what all views look
// at and none sees past.
//
// In rounds, at about 190 pixels: histograms of the colours inside and outside (color_odds.h) and
// the silhouette of what the views have in common (common_hull.h) say for each pixel how probable
// the object is there; pixels agree with their neighbours up to the picture's edges
// (PixelField); cells of a grid that too many views see past are emptied. Shadows are told from
// the object by the floor that they lie on (floor.h). This is N. Campbell et al., Automatic 3D
// object segmentation in multiple views using volumetric graph-cuts (2010), with a mean field for
// their graph cut and a floor. All views share the colours, so that what stands behind the object
// in one is known from those that see it beside. Where the object itself has the background's
// colours, masks get holes, through which the object would be lost from all views; those that do
// not show the floor as other views see it are closed (holes.h), and some rounds follow. In the end
// once at full resolution.
#pragma once

#include <vector>

#include "base/parallel.h"
#include "fit/input.h"

namespace tilegrad::train {

struct FoundMasks {
  std::vector<float> alpha;  // [N,H,W], multiples of 1 / 255
  // Of each view, the IoU of its mask and the silhouette of what all have in common.
  std::vector<double> agreement;
};

// All views should show the whole object, nearly in the middle; alpha must be 1. A pure function of
// cameras and colours for any number of workers. Errors: those of GuessSphere; kCancelled.
Result<FoundMasks> FindMasks(const FitInput& input, const Workers& workers,
                             const Watch& watch = {});

}  // namespace tilegrad::train
