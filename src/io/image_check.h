// SPDX-License-Identifier: Apache-2.0
// Internal to io: what stb_image lets pass. It compares no PNG checksum, so that a changed header
// gives a garbled picture, and fills the missing part of a cut JPEG with grey.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "tilegrad/status.h"

namespace tilegrad::io {

// OK for anything that is neither PNG, JPEG nor PGM or PPM. PNG: every chunk lies in the file, its
// checksum is right, and the end chunk is there. JPEG: every segment lies in the file, and the end
// marker is there, and Huffman tables have a size that stb_image can take. PGM and PPM: the numbers
// of the header fit into int. Errors name `name` and the byte.
Status CheckImageContainer(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace tilegrad::io
