// SPDX-License-Identifier: Apache-2.0
// Writes meshes as binary glTF 2.0, which every viewer opens.
#pragma once

#include "base/file.h"
#include "scene/mesh.h"

namespace tilegrad::io {

// One primitive a material that is used. Positions, faces, normals, vertex colours, uv, base
// colours, textures (as PNG inside) and everything else of materials are kept; per-corner
// attributes split vertices where they must. Colours are stored linear, as glTF asks; LoadMesh
// turns them back. An error if the mesh is not valid or has no face.
Result<Bytes> EncodeGlb(const Mesh& mesh);
Status SaveGlb(const Path& path, const Mesh& mesh);  // whole or not at all

}  // namespace tilegrad::io
