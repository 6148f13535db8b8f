// SPDX-License-Identifier: Apache-2.0
#include "render/quick_checks.h"

namespace tilegrad {

bool IsFiniteCamera(const Camera& camera) {
  const float numbers[5] = {camera.fx, camera.fy, camera.cx, camera.cy, camera.near_plane};
  return AllFinite(camera.rotation) && AllFinite(camera.translation) && AllFinite(numbers);
}

}  // namespace tilegrad
