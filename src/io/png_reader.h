// SPDX-License-Identifier: Apache-2.0
// Internal to io: decodes the common kinds of PNG with libdeflate, in half the time of stb_image.
#pragma once

#include <optional>
#include <span>

#include "scene/image.h"

namespace tilegrad::io {

// Decodes a PNG with 8 bits per channel and neither palette, transparent colour nor interlacing: 1
// to 4 channels as in the file, with stb_image's pixels. Returns nothing for other and damaged PNGs
// and if out of memory; stb_image then reads or refuses the file. `bytes` must have passed
// CheckImageContainer and CheckImageSize.
std::optional<ImageU8> DecodePlainPng(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
