// SPDX-License-Identifier: Apache-2.0
// Internal to io: the size that the header of an image says.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace tilegrad::io {

struct HeaderSize {
  std::int64_t width = 0, height = 0;
};

// Of PNG, JPEG, BMP and TGA; nothing for other bytes, or where the header is cut short. stb_image
// calls what is larger than its limit no image at all.
std::optional<HeaderSize> ImageHeaderSize(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
