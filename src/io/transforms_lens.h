// SPDX-License-Identifier: Apache-2.0
// Internal to io: what a NeRF program's transforms.json says about the lens.
#pragma once

#include "io/json_frame.h"
#include "scene/lens_distortion.h"

namespace tilegrad::io {

// By camera_model of nerfstudio and COLMAP, the flags of instant-ngp, and the coefficients of
// distortion. An error names the key of what is no lens of lens_distortion.h.
Result<LensDistortion> LensOf(const JsonFrame& frame);

// An error, unless it is straight, that says what to do.
Status CheckStraight(const LensDistortion& lens);

}  // namespace tilegrad::io
