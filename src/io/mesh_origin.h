// SPDX-License-Identifier: Apache-2.0
// Internal to io: coordinates that are too far from the origin for float.
#pragma once

#include "io/mesh_file.h"

namespace tilegrad::io {

// Sets the mesh's positions from `exact`, which it takes. Where the mesh is farther from the origin
// than 256 times its size, float would keep less than 16 bits of its shape: a point near its middle
// is subtracted before, from cameras too, becomes `origin`, and is a warning. Coordinates that come
// in steps which the file's own precision is too low for are another.
void PlaceNearOrigin(LoadedMesh& loaded);

}  // namespace tilegrad::io
