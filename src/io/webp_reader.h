// SPDX-License-Identifier: Apache-2.0
// Internal to io: still images in WebP, by libwebp.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "scene/image.h"
#include "tilegrad/status.h"

namespace tilegrad::io {

bool IsWebp(std::span<const std::uint8_t> bytes);

// 3 or 4 channels, as stored. `name` stands in error messages.
Result<ImageU8> DecodeWebp(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace tilegrad::io
