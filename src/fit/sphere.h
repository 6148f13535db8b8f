// SPDX-License-Identifier: Apache-2.0
// Where the object of an input is, roughly.
#pragma once

#include "fit/input.h"

namespace tilegrad::train {

// The sphere that looks from all training views about as large as the object: of the radius that
// gives the mean area of the masks, around the point closest to all optical axes; where these are
// parallel or meet behind a camera, closest to all rays through the masks' middles. Views that see
// it from one direction do not tell how far away it is, and those in a narrow cone little: `doubt`
// says so then, and what is taken.
struct Sphere {
  glm::vec3 centre = {0, 0, 0};
  float radius = 1;
  std::string doubt;
};
// An error names a camera that faces away from that point, or what is wrong with the numbers.
Result<Sphere> GuessSphere(const FitInput& input);

}  // namespace tilegrad::train
