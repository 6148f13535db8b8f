// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "io/mesh_file.h"
#include "proof/tradeoff_study.h"
#include "scene/camera.h"
#include "scene/shapes.h"

namespace tilegrad::cli {
namespace {

StudyScene SceneOf(std::string name, const Mesh& mesh, int size) {
  StudyScene out;
  out.name = std::move(name);
  out.size = size;
  for (const glm::vec3& p : mesh.positions) {
    for (int i = 0; i < 3; ++i) out.positions.push_back(p[i]);
  }
  for (const Face& face : mesh.faces) out.faces.insert(out.faces.end(), face.begin(), face.end());
  out.camera = OrbitCamera({30.0, size, size}, 40, 25, 2.732);
  return out;
}

void AddBumps(Mesh* mesh) {
  for (glm::vec3& p : mesh->positions) {
    p *= 1 + 0.15f * std::sin(22 * p.x) * std::sin(18 * p.y + 1) * std::sin(20 * p.z + 2);
  }
}

}  // namespace

std::vector<StudyScene> BuiltInScenes() {
  Mesh bumpy = Icosphere(5, 0.5f);
  AddBumps(&bumpy);
  return {SceneOf("sphere", Icosphere(3, 0.5f), 64), SceneOf("bumpy", bumpy, 256)};
}

Result<StudyScene> SceneFromFile(const Path& file, int size) {
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(file));
  TILEGRAD_TRY(NormalizeToBox(loaded.mesh, 0.45f).Within(file.string()));
  return SceneOf(file.stem().string(), loaded.mesh, size);
}

}  // namespace tilegrad::cli
