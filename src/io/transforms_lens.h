// SPDX-License-Identifier: Apache-2.0
// What a NeRF program's transforms.json says about the lens. The camera here is a pinhole, so
// everything that bends rays is refused, as it is in COLMAP's models (colmap_cameras.cc).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tilegrad/status.h"

namespace tilegrad::io {

// An error that names the key, unless the frame is seen by a pinhole: camera_model of nerfstudio
// and COLMAP, the flags of instant-ngp, and the coefficients of distortion, which must be 0. What
// the frame omits is taken from `top`. Both are objects.
Status CheckPinhole(const nlohmann::json& top, const nlohmann::json& frame);

// Windows programs write "images\\0001.png": with slashes, as every system reads it.
std::string PortablePath(std::string path);

}  // namespace tilegrad::io
