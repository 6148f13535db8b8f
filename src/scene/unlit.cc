// SPDX-License-Identifier: Apache-2.0
#include "scene/unlit.h"

namespace tilegrad {

void SetUnlit(Mesh& mesh, const std::string& name) {
  if (mesh.materials.empty()) mesh.materials = {{.name = name, .base_color = glm::vec4(1)}};
  for (Material& material : mesh.materials) material.unlit = true;
}

}  // namespace tilegrad
