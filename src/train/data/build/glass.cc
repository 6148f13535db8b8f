// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/glass.h"

#include <algorithm>

namespace tilegrad::train {
namespace {

template <class T>
void Keep(std::vector<T>* values, const std::vector<char>& keep_face, std::size_t per_face) {
  if (values->empty()) return;
  std::size_t to = 0;
  for (std::size_t f = 0; f < keep_face.size(); ++f) {
    if (!keep_face[f]) continue;
    for (std::size_t k = 0; k < per_face; ++k) (*values)[to++] = (*values)[f * per_face + k];
  }
  values->resize(to);
}

}  // namespace

void RemoveGlass(Mesh* mesh) {
  if (mesh->materials.empty()) return;
  std::vector<char> keep(mesh->faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    const auto m =
        mesh->face_materials.empty() ? 0 : static_cast<std::size_t>(mesh->face_materials[f]);
    keep[f] = mesh->materials[m].base_color.a >= kGlassAlpha;
  }
  if (std::find(keep.begin(), keep.end(), 1) == keep.end()) return;
  Keep(&mesh->faces, keep, 1);
  Keep(&mesh->face_materials, keep, 1);
  Keep(&mesh->corner_uvs, keep, 3);
  Keep(&mesh->corner_colors, keep, 3);
  Keep(&mesh->corner_normals, keep, 3);
}

}  // namespace tilegrad::train
