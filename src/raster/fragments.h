// SPDX-License-Identifier: Apache-2.0
// The result of visibility is one number per pixel: the face that is seen.
#pragma once

#include <cstdint>

namespace tilegrad::raster {

inline constexpr std::int32_t kNoFace = -1;  // a background pixel

}  // namespace tilegrad::raster
