// SPDX-License-Identifier: Apache-2.0
// Yes or no, fast: what is wrong, and where, is found by validate.h afterwards.
#pragma once

#include "base/array_checks.h"
#include "scene/camera.h"

namespace tilegrad {

bool IsFiniteCamera(const Camera& camera);  // all of its numbers
// No focal length is 0, and the near plane is above it, too.
bool IsSoundCamera(const Camera& camera);

}  // namespace tilegrad
