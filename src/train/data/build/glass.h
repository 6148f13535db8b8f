// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/mesh.h"

namespace tilegrad::train {

inline constexpr float kGlassAlpha = 0.2f;  // materials with less are glass

// Removes faces of glass, because people see what is behind them, unless nothing would be left.
// Everything else counts as opaque.
void RemoveGlass(Mesh* mesh);

}  // namespace tilegrad::train
