// SPDX-License-Identifier: Apache-2.0
// Which edges of a mesh look sharp.
#pragma once

#include "scene/mesh.h"

namespace tilegrad {

// Makes smooth normals (of vertices, from positions) break at edges where faces meet at an angle of
// `degrees` or more: what stands at one place becomes one vertex for each group of faces that are
// joined by smoother edges, however many vertices the file had there. Faces keep their order and
// their corners; colours of vertices become those of corners, normals of vertices go. The mesh is
// valid.
void SplitAtCreases(double degrees, Mesh* mesh);

}  // namespace tilegrad
