// SPDX-License-Identifier: Apache-2.0
// Which cameras can be fitted with.
#pragma once

#include "scene/camera.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// Cameras are kept as floats, and a fit divides and multiplies by their numbers: an error says
// which of these is beyond what that bears, of images of this size. Also those of Validate.
Status CheckCamera(const Camera64& camera, ImageSize image);

}  // namespace tilegrad::train
