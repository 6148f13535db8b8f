// SPDX-License-Identifier: Apache-2.0
// Where one more picture would help most: the direction farthest from all cameras.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <string>

#include "scene/camera.h"

namespace tilegrad::train {

// A direction from the object, relative to the nearest camera.
struct ViewGap {
  std::size_t nearest = 0;  // index of that camera
  double degrees = 0;       // angle between the two at the object
  // From the camera to the direction: around the object to the photographer's right, and upwards.
  double right = 0, up = 0;  // degrees
};

// The direction from the object's `middle` with the largest gap, of those every 5 degrees around
// and from level to 60 degrees above. Needs at least one camera. Up is the cameras' mean up,
// because people hold them level on the whole.
ViewGap WidestGap(std::span<const Camera> cameras, glm::vec3 middle);

// "about 40 degrees to the right of NAME and 20 higher"
std::string DescribePlace(const ViewGap& gap, const std::string& name);

}  // namespace tilegrad::train
