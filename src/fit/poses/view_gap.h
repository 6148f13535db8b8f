// SPDX-License-Identifier: Apache-2.0
// Where one more picture would tell most: the direction that is furthest from all cameras.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <string>

#include "scene/camera.h"

namespace tilegrad::train {

// A direction from the object, beside the camera that is nearest to it.
struct ViewGap {
  std::size_t nearest = 0;  // index of that camera
  double degrees = 0;       // between the two, seen from the object
  // The way from the camera there: around the object to the photographer's right, and upwards.
  double right = 0, up = 0;  // degrees
};

// Of directions from the object's `middle`, every 5 degrees around and from level to 60 above, the
// one with the largest gap. At least one camera; people hold them level on the whole.
ViewGap WidestGap(std::span<const Camera> cameras, glm::vec3 middle);

// "about 40 degrees to the right of NAME and 20 higher"
std::string DescribePlace(const ViewGap& gap, const std::string& name);

}  // namespace tilegrad::train
