// SPDX-License-Identifier: Apache-2.0
// Internal to io: the size that the header of an image says.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace tilegrad::io {

struct HeaderSize {
  std::int64_t width = 0, height = 0;
};

// Of PNG, JPEG, BMP and TGA; nothing for other bytes, or where the header is cut short. stb_image
// calls what is larger than its limit no image at all.
std::optional<HeaderSize> ImageHeaderSize(std::span<const std::uint8_t> bytes);

// The number of at most four bytes, the first of them the highest.
std::uint32_t BigEndian(std::span<const std::uint8_t> bytes);

// "GIF" and the like, by its first bytes: a format that is not read, whatever the file is called.
// Empty for others.
std::string_view UnreadImageFormat(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
