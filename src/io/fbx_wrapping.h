// SPDX-License-Identifier: Apache-2.0
// Internal to io: what Assimp's FBX importer does not tell of a file.
#pragma once

#include <span>

#include "base/file.h"

namespace tilegrad::io {

// Whether some texture of the FBX file, text or binary, does not repeat: its WrapModeU or WrapModeV
// is not 0. Of damaged files anything, but nothing outside of `file` is read.
bool HasClampedFbxTexture(std::span<const std::uint8_t> file);

}  // namespace tilegrad::io
