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
// `origin` is added by the node, in double: LoadedMesh::origin.
Result<Bytes> EncodeGlb(const Mesh& mesh, const glm::dvec3& origin = glm::dvec3(0));
Status SaveGlb(const Path& path, const Mesh& mesh,
               const glm::dvec3& origin = glm::dvec3(0));  // whole or not at all

// With a white directional light (KHR_lights_punctual) from the direction `sun`, not 0: a surface
// that faces it has its base colour. It lights materials that are not `unlit`.
Result<Bytes> EncodeLitGlb(const Mesh& mesh, const glm::dvec3& sun);
Status SaveLitGlb(const Path& path, const Mesh& mesh, const glm::dvec3& sun);

}  // namespace tilegrad::io
