// SPDX-License-Identifier: Apache-2.0
// Writes meshes as binary glTF 2.0, which every viewer opens.
#pragma once

#include <optional>

#include "base/file.h"
#include "scene/mesh.h"

namespace tilegrad::io {

struct GlbOptions {
  glm::dvec3 origin = glm::dvec3(0);  // added by the node, in double: LoadedMesh::origin
  // From this direction, not 0, comes a white directional light (KHR_lights_punctual): a surface
  // that faces it has its base colour. It lights materials that are not `unlit`.
  std::optional<glm::dvec3> sun = std::nullopt;
};

// One primitive a material that is used. Positions, faces, normals, vertex colours, uv, base
// colours, textures (as PNG inside) and everything else of materials are kept; per-corner
// attributes split vertices where they must. Colours are stored linear, as glTF asks; LoadMesh
// turns them back. An error if the mesh is not valid or has no face.
Result<Bytes> EncodeGlb(const Mesh& mesh, const GlbOptions& options = {});
Status SaveGlb(const Path& path, const Mesh& mesh,
               const GlbOptions& options = {});  // whole or not at all

}  // namespace tilegrad::io
