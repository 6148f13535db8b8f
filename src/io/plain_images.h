// SPDX-License-Identifier: Apache-2.0
// Internal to io: formats that stb_image does not read, or not whole: those of Netpbm and of SGI.
#pragma once

#include <span>
#include <string>

#include "base/error.h"
#include "scene/image.h"

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

}  // namespace tilegrad::io
