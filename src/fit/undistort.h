// SPDX-License-Identifier: Apache-2.0
// Images of lenses that bend rays, as a straight lens would have taken them.
#pragma once

#include "fit/view_pixels.h"
#include "scene/camera.h"

namespace tilegrad::train {

// Takes what `lens` bends out of colours and alpha, bilinearly, and returns the camera of the image
// that is left: `camera`, or where the object would leave the image one with a shorter focal
// length, so that it stays whole. What the lens did not see is no object where there is a mask, and
// continues the border where there is none.
Camera Undistort(const LensDistortion& lens, const Camera& camera, ViewPixels* view);

}  // namespace tilegrad::train
