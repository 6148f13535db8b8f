// SPDX-License-Identifier: Apache-2.0
// Images of lenses that bend rays, as a straight lens would have taken them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "fit/frames.h"
#include "scene/camera.h"

namespace tilegrad::train {

// One image with its mask, as a fit takes it.

struct ViewPixels {
  ImageSize size;
  std::vector<float> color, alpha;  // [3,H,W] straight, [H,W]
  std::string mask;                 // where the alpha is from, for messages; empty: it is all 1

  std::size_t pixels() const { return alpha.size(); }
};

// alpha [H,W] of a mask file of that size, or of a multiple, as reduced images had (input.h).
// Errors name the file.
Status LoadMask(const Path& path, ImageSize size, std::span<float> alpha);

// Turned as the frame's camera counts pixels. Errors name the file.
Result<ViewPixels> LoadViewPixels(const InputFrame& frame);

// Takes what `lens` bends out of colours and alpha, bilinearly, and returns the camera of the image
// that is left: `camera`, or where the object would leave the image one with a shorter focal
// length, so that it stays whole. What the lens did not see is no object where there is a mask, and
// continues the border where there is none.
Camera Undistort(const LensDistortion& lens, const Camera& camera, ViewPixels* view);

}  // namespace tilegrad::train
