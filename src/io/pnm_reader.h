// SPDX-License-Identifier: Apache-2.0
// Binary PGM and PPM (P5, P6), the formats of Netpbm.
#pragma once

#include <span>
#include <string>

#include "base/error.h"
#include "scene/image.h"

namespace tilegrad::io {

bool IsPnm(std::span<const std::uint8_t> bytes);

// 1 or 3 channels. Samples are scaled from 0 to the file's maximum (at most 65535) to 0 to 255.
// What follows the first image is not looked at. `name` stands in error messages.
Result<ImageU8> DecodePnm(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace tilegrad::io
