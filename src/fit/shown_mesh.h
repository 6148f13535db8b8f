// SPDX-License-Identifier: Apache-2.0
// The mesh of a fit as pages show it while it forms.
#pragma once

#include "fit/scene.h"

namespace tilegrad::train {

// Positions, faces, and a colour for each vertex, of its own or from the texture at its corners:
// small, where MeshOfScene has the texture.
Mesh ShownMesh(const FitScene& scene);

}  // namespace tilegrad::train
