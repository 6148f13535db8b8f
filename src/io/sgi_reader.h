// SPDX-License-Identifier: Apache-2.0
// SGI images (.rgb, .rgba, .bw, .sgi), as games and flight simulators of the time hold textures:
// "The SGI Image File Format", version 1.00 (Paul Haeberli).
#pragma once

#include <span>
#include <string>

#include "base/error.h"
#include "scene/image.h"

namespace tilegrad::io {

bool IsSgi(std::span<const std::uint8_t> bytes);

// 1 to 4 channels of 8 or 16 bits, as they are or run-length encoded; 16 bits are scaled to 8. Row
// 0 of the result is the top one; the file begins at the bottom. Palettes (colour map codes other
// than 0) are refused. `name` stands in error messages, which say the byte, or row and channel.
Result<ImageU8> DecodeSgi(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace tilegrad::io
