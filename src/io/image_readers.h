// SPDX-License-Identifier: Apache-2.0
// Internal to io: formats that stb_image does not read, or not whole (Netpbm, SGI, WebP), and
// checks of those that it reads.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "scene/image.h"
#include "tilegrad/status.h"

namespace tilegrad::io {

// Binary PGM and PPM (P5, P6).
bool IsPnm(std::span<const std::uint8_t> bytes);

// 1 or 3 channels. Samples are scaled from 0 to the file's maximum (at most 65535) to 0 to 255.
// What follows the first image is not looked at. `name` stands in error messages.
Result<ImageU8> DecodePnm(std::span<const std::uint8_t> bytes, const std::string& name);

// Images of SGI (.rgb, .rgba, .bw, .sgi), as games and flight simulators of the time hold textures:
// "The SGI Image File Format", version 1.00 (Paul Haeberli).
bool IsSgi(std::span<const std::uint8_t> bytes);

// 1 to 4 channels of 8 or 16 bits, as they are or run-length encoded; 16 bits are scaled to 8. Row
// 0 of the result is the top one; the file begins at the bottom. Palettes (colour map codes other
// than 0) are refused. `name` stands in error messages, which say the byte, or row and channel.
Result<ImageU8> DecodeSgi(std::span<const std::uint8_t> bytes, const std::string& name);

// Still images in WebP, by libwebp.

bool IsWebp(std::span<const std::uint8_t> bytes);

// 3 or 4 channels, as stored. `name` stands in error messages.
Result<ImageU8> DecodeWebp(std::span<const std::uint8_t> bytes, const std::string& name);

// Checks that stb_image omits. It ignores PNG checksums, so that a corrupt header
// gives a garbled picture; it fills the missing part of a truncated JPEG with grey, and that of
// other formats with whatever was in memory.

// The number of at most four bytes: the first of them the highest, or the lowest.
std::uint32_t BigEndian(std::span<const std::uint8_t> bytes);
std::uint32_t LittleEndian(std::span<const std::uint8_t> bytes);

bool IsPng(std::span<const std::uint8_t> bytes);
// Like stb_image after any number of filler bytes.
bool IsJpeg(std::span<const std::uint8_t> bytes);

// OK for anything that is neither PNG nor JPEG. PNG: every chunk lies in the file, its checksum is
// right, and the end chunk is there. JPEG: every segment lies in the file, and the end marker is
// there, and Huffman tables have a size that stb_image can take, and there are at most 100 scans.
// Errors name `name` and the byte, or the sides where those of a PNG are not within
// [1, kMaxImageSide].
Status CheckImageContainer(std::span<const std::uint8_t> bytes, const std::string& name);

// Both sides within [1, kMaxImageSide].
Status CheckImageSize(std::int64_t width, std::int64_t height, const std::string& name);

// A PNG that passed CheckImageContainer with its palette made 256 colours, those that are added
// black; nothing if it has none or a full one. stb_image 2.27 takes colours beyond the palette from
// memory that it never wrote.
std::optional<Bytes> WithFullPalette(std::span<const std::uint8_t> bytes);

// OK for anything but BMP and TGA, which stb_image fills up with what is in memory: all pixels are
// in the file, and their colours in the palette. Expects a header that stb_image takes.
Status CheckRawPixels(std::span<const std::uint8_t> bytes, int width, int height,
                      const std::string& name);

// "GIF" and the like, by its first bytes: a format that is not read, whatever the file is called.
// Empty for others.
std::string_view UnreadImageFormat(std::span<const std::uint8_t> bytes);

}  // namespace tilegrad::io
