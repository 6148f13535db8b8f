// SPDX-License-Identifier: Apache-2.0
#include "render/pipeline/quick_checks.h"

namespace tilegrad {

bool IsFiniteCamera(const Camera& camera) {
  const float numbers[5] = {camera.fx, camera.fy, camera.cx, camera.cy, camera.near_plane};
  return AllFinite(camera.rotation) && AllFinite(camera.translation) && AllFinite(numbers);
}

bool IsSoundCamera(const Camera& camera) {
  return IsFiniteCamera(camera) && camera.fx != 0 && camera.fy != 0 && camera.near_plane > 0;
}

}  // namespace tilegrad
