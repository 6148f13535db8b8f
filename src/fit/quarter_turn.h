// SPDX-License-Identifier: Apache-2.0
// Images that were taken with the camera on its side, beside those that were not: turned by 90
// degrees together with their cameras, which loses nothing, all have one size.
#pragma once

#include <span>
#include <vector>

#include "fit/input.h"
#include "scene/camera.h"
#include "scene/image.h"

namespace tilegrad::train {

// Planes [N,H,W] of `size`, turned clockwise: [N,W,H].
std::vector<float> TurnedPlanes(std::span<const float> planes, ImageSize size);
// The camera of the turned image; `height`: pixels before.
Camera TurnedCamera(const Camera& camera, int height);

// Cameras and images of an input's views with those turned back that were turned: as cameras were
// held, and as people want to see images.
std::vector<Camera> HeldCameras(const FitInput& input, std::span<const Camera> cameras);
ImageU8 HeldImage(const FitInput& input, std::size_t view, ImageU8 image);

}  // namespace tilegrad::train
