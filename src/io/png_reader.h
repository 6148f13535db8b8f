// SPDX-License-Identifier: Apache-2.0
// Internal to io: the PNG files that most programs write, by libdeflate, which unpacks them faster
// than stb_image.
#pragma once

#include <optional>
#include <span>

#include "scene/image.h"

namespace tilegrad::io {

// The pixels of a PNG of 8 bits a channel that has neither palette, transparent colour nor
// interlacing: 1 to 4 channels as in the file, the same that stb_image gives. Nothing for other
// PNGs, for damaged ones, and where there is no memory: those are stb_image's to read or to refuse.
// Expects a PNG that passed CheckImageContainer and whose sides suit its size.
std::optional<ImageU8> DecodePlainPng(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
