// SPDX-License-Identifier: Apache-2.0
// Internal to io: colours of vertices, corners and materials as files have them.
#pragma once

#include "io/mesh_file.h"

namespace tilegrad::io {

// Colours are 0 to 1: bytes are scaled, what is more is cut, each with a warning.
void ClampColors(LoadedMesh& loaded);

// A warning if colours of vertices or faces have an alpha below 1 that nothing draws, because all
// materials are opaque.
void WarnOfTransparentColors(LoadedMesh& loaded);

}  // namespace tilegrad::io
