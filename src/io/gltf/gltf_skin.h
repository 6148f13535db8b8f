// SPDX-License-Identifier: Apache-2.0
// Internal to io: skinned meshes of glTF files as they stand at rest.
#pragma once

#include <glm/mat4x4.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/gltf/gltf_model.h"
#include "scene/mesh.h"

namespace tilegrad::io {

// Of each joint of a skin: from where the vertices were bound to where they stand. `world`: of all
// nodes. DataLoss names `what` and what does not exist.
Result<std::vector<glm::dmat4>> GltfJointMatrices(const tinygltf::Model& model, int skin,
                                                  std::span<const glm::dmat4> world,
                                                  const std::string& what);

// Whether the primitive says which joints hold its vertices.
bool IsSkinned(const tinygltf::Primitive& p);

// Moves the vertices of the primitive's mesh to where their joints hold them. Weights need not sum
// to 1; a vertex without any goes with its first joint. `exact` gets them before they are rounded.
Status ApplyGltfSkin(const tinygltf::Model& model, const tinygltf::Primitive& p,
                     std::span<const glm::dmat4> joints, const std::string& what, Mesh* mesh,
                     std::vector<glm::dvec3>* exact);

}  // namespace tilegrad::io
