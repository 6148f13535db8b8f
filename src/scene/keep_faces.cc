// SPDX-License-Identifier: Apache-2.0
#include "scene/keep_faces.h"

#include <algorithm>

namespace tilegrad {
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

bool KeepFaces(const std::vector<char>& keep, Mesh* mesh) {
  if (std::all_of(keep.begin(), keep.end(), [](char k) { return k == 0; })) return false;
  Keep(&mesh->faces, keep, 1);
  Keep(&mesh->face_materials, keep, 1);
  Keep(&mesh->corner_uvs, keep, 3);
  Keep(&mesh->corner_colors, keep, 3);
  Keep(&mesh->corner_normals, keep, 3);
  return true;
}

}  // namespace tilegrad
