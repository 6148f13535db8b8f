// SPDX-License-Identifier: Apache-2.0
// Internal to io: where the nodes of a glTF file stand.
#pragma once

#include <glm/mat4x4.hpp>
#include <vector>

#include "io/gltf/gltf_model.h"

namespace tilegrad::io {

// Nodes that are nobody's child.
std::vector<int> GltfRootNodes(const tinygltf::Model& model);

// Of its matrix, or of its translation, rotation and scale.
glm::dmat4 GltfLocalMatrix(const tinygltf::Node& node);

// From each node to the world, whether it is part of a scene or not. Of nodes that form no tree,
// anything.
std::vector<glm::dmat4> GltfWorldMatrices(const tinygltf::Model& model);

}  // namespace tilegrad::io
