// SPDX-License-Identifier: Apache-2.0
// Masks of objects before a plain background: paper, a wall, a green screen.
//
// 1. The border of the picture (2 % of its shorter side) shows background, but where the object
//    leaves the picture. A plane of each channel, a + b x + c y, is fitted to it by least squares,
//    five times, each without what was farthest off before: light falls off across a wall.
// 2. A pixel belongs to the background if the picture, averaged over 3 x 3 pixels against noise, is
//    within a threshold of that model: 4 standard deviations of the border, at least 0.05.
// 3. Background is what such pixels connect with the border (4 neighbours), so that an object may
//    have the background's colour inside. Enclosed areas are holes, and background, if they lie
//    within half the threshold and have at least 0.05 % of the picture's pixels.
// 4. The averages reach a pixel too far: of the object's outermost pixels, those that are
// themselves
//    within the threshold are background.
// 5. Specks below 2 % of the object's largest part go. Edges are softened over 3 x 3 pixels.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "scene/image.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

struct BackgroundMask {
  std::vector<float> alpha;  // [H,W]
  // Empty where all is well; else why the mask is in doubt, in words for people: the background is
  // not plain, or no object stands out.
  std::string doubt;
};

// `color`: [3,H,W] in [0, 1].
BackgroundMask MaskFromPlainBackground(std::span<const float> color, int width, int height);

// Whether every pixel is: a picture that is not cut out.
bool IsOpaque(const ImageU8& image);
// An opaque picture with its background transparent. An error says why there is none to be seen.
Result<ImageU8> WithoutPlainBackground(const ImageU8& image);

}  // namespace tilegrad::train
