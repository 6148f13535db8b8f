// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/glass.h"

#include "scene/mesh.h"

namespace tilegrad::train {

void RemoveGlass(Mesh* mesh) {
  if (mesh->materials.empty()) return;
  std::vector<char> keep(mesh->faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    const auto m =
        mesh->face_materials.empty() ? 0 : static_cast<std::size_t>(mesh->face_materials[f]);
    keep[f] = mesh->materials[m].base_color.a >= kGlassAlpha;
  }
  KeepFaces(keep, mesh);
}

}  // namespace tilegrad::train
