// SPDX-License-Identifier: Apache-2.0
// Portrait images among landscape ones, or the reverse: rotated by 90 degrees together with their
// cameras, which is exact, all images have one size.
#pragma once

#include <span>
#include <vector>

#include "fit/input.h"
#include "scene/camera.h"
#include "scene/image.h"

namespace tilegrad::train {

bool IsTurned(const FitInput& input, std::size_t view);

// Planes [N,H,W] of `size`, rotated clockwise: [N,W,H].
std::vector<float> TurnedPlanes(std::span<const float> planes, ImageSize size);
// The camera of the rotated image; `height`: pixels before.
Camera TurnedCamera(const Camera& camera, int height);

// Cameras and images of an input's views as they were taken: rotated back where IsTurned.
std::vector<Camera> HeldCameras(const FitInput& input, std::span<const Camera> cameras);
ImageU8 HeldImage(const FitInput& input, std::size_t view, ImageU8 image);

}  // namespace tilegrad::train
