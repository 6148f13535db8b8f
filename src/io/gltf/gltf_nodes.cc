// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_nodes.h"

#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>

namespace tilegrad::io {

std::vector<int> GltfRootNodes(const tinygltf::Model& model) {
  std::vector<bool> child(model.nodes.size(), false);
  for (const auto& node : model.nodes) {
    for (const int c : node.children) {
      if (c >= 0 && c < static_cast<int>(child.size())) child[c] = true;
    }
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < child.size(); ++i) {
    if (!child[i]) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

glm::dmat4 GltfLocalMatrix(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return glm::make_mat4(node.matrix.data());
  glm::dmat4 m(1);
  const auto& t = node.translation;
  const auto& r = node.rotation;
  const auto& s = node.scale;
  if (r.size() == 4) m = glm::mat4_cast(glm::normalize(glm::dquat(r[3], r[0], r[1], r[2])));
  if (s.size() == 3) {
    for (int c = 0; c < 3; ++c) m[c] *= s[static_cast<std::size_t>(c)];
  }
  if (t.size() == 3) m[3] = glm::dvec4(t[0], t[1], t[2], 1);
  return m;
}

std::vector<glm::dmat4> GltfWorldMatrices(const tinygltf::Model& model) {
  std::vector<glm::dmat4> world(model.nodes.size(), glm::dmat4(1));
  std::vector<bool> known(model.nodes.size(), false);
  std::vector<int> open = GltfRootNodes(model);
  for (const int root : open) world[root] = GltfLocalMatrix(model.nodes[root]);
  while (!open.empty()) {
    const int parent = open.back();
    open.pop_back();
    if (known[parent]) continue;
    known[parent] = true;
    for (const int child : model.nodes[parent].children) {
      if (child < 0 || child >= static_cast<int>(world.size()) || known[child]) continue;
      world[child] = world[parent] * GltfLocalMatrix(model.nodes[child]);
      open.push_back(child);
    }
  }
  return world;
}

}  // namespace tilegrad::io
