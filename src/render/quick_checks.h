// SPDX-License-Identifier: Apache-2.0
// Yes or no, fast: what is wrong, and where, is found by validate.h afterwards.
#pragma once

#include "base/array_checks.h"
#include "scene/camera.h"

namespace tilegrad {

bool IsFiniteCamera(const Camera& camera);  // all of its numbers
// Focal lengths and near plane are above 0, too.
bool IsSoundCamera(const Camera& camera);

}  // namespace tilegrad
