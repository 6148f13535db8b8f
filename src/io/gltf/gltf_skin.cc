// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_skin.h"

#include <glm/geometric.hpp>

#include "base/error.h"

namespace tilegrad::io {
namespace {

// JOINTS_n and WEIGHTS_n: four joints more of each vertex.
struct Influences {
  GltfAccessor joints, weights;
};

Result<GltfAccessor> OpenFour(const tinygltf::Model& model, const tinygltf::Primitive& p,
                              const std::string& key, std::size_t vertices,
                              const std::string& what) {
  const auto found = p.attributes.find(key);
  if (found == p.attributes.end()) return DataLoss("{}: no {} beside its other half", what, key);
  const std::string place = what + ": " + key;
  TILEGRAD_ASSIGN(GltfAccessor out, GltfAccessor::OpenAttribute(model, found->second, 4, place));
  if (out.count() != vertices)
    return DataLoss("{} has {} elements for {} vertices", place, out.count(), vertices);
  return out;
}

Result<std::vector<Influences>> ReadInfluences(const tinygltf::Model& model,
                                               const tinygltf::Primitive& p, std::size_t vertices,
                                               const std::string& what) {
  std::vector<Influences> out;
  for (int set = 0;; ++set) {
    const std::string joints = fmt::format("JOINTS_{}", set);
    const std::string weights = fmt::format("WEIGHTS_{}", set);
    if (p.attributes.count(joints) + p.attributes.count(weights) == 0) return out;
    TILEGRAD_ASSIGN(GltfAccessor j, OpenFour(model, p, joints, vertices, what));
    TILEGRAD_ASSIGN(GltfAccessor w, OpenFour(model, p, weights, vertices, what));
    out.push_back({std::move(j), std::move(w)});
  }
}

// The mean of a vertex's joints, by their weights.
Result<glm::dmat4> MatrixOf(const std::vector<Influences>& influences, std::size_t vertex,
                            std::span<const glm::dmat4> joints, const std::string& what) {
  glm::dmat4 sum(0);
  double total = 0;
  const auto joint = [&](const Influences& from, int k) {
    return static_cast<double>(from.joints.Float(vertex, k));
  };
  const auto add = [&](double index, double weight) -> Status {
    if (!(index >= 0 && index < static_cast<double>(joints.size()))) {
      return DataLoss("{}: vertex {} uses joint {}, but its skin has {}", what, vertex, index,
                      joints.size());
    }
    sum += weight * joints[static_cast<std::size_t>(index)];
    total += weight;
    return {};
  };
  for (const Influences& from : influences) {
    for (int k = 0; k < 4; ++k) {
      const auto weight = static_cast<double>(from.weights.Float(vertex, k));
      if (weight != 0) TILEGRAD_TRY(add(joint(from, k), weight));
    }
  }
  if (total == 0) {
    sum = glm::dmat4(0);
    TILEGRAD_TRY(add(joint(influences[0], 0), 1));
  }
  return sum / total;
}

// As Transform of scene/shapes.h, without its turning of faces: what is mirrored is the whole mesh.
void TurnNormal(const glm::dmat3& m, glm::vec3* n) {
  const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
  const glm::dvec3 turned = cofactor * glm::dvec3(*n);
  const double length = glm::length(turned);
  if (length > 0) *n = glm::vec3(turned / length);
}

}  // namespace

Result<std::vector<glm::dmat4>> GltfJointMatrices(const tinygltf::Model& model, int skin,
                                                  std::span<const glm::dmat4> world,
                                                  const std::string& what) {
  if (skin < 0 || skin >= static_cast<int>(model.skins.size()))
    return DataLoss("{}: skin {} does not exist", what, skin);
  const tinygltf::Skin& from = model.skins[skin];
  std::vector<glm::dmat4> out;
  for (const int joint : from.joints) {
    if (joint < 0 || joint >= static_cast<int>(world.size()))
      return DataLoss("{}: skin {}: node {}, a joint, does not exist", what, skin, joint);
    out.push_back(world[joint]);
  }
  if (from.inverseBindMatrices < 0) return out;
  const std::string place = fmt::format("{}: skin {}: inverse bind matrices", what, skin);
  TILEGRAD_ASSIGN(const GltfAccessor inverse,
                  GltfAccessor::OpenAttribute(model, from.inverseBindMatrices, 16, place));
  if (inverse.count() < out.size())
    return DataLoss("{}: {} for {} joints", place, inverse.count(), out.size());
  for (std::size_t j = 0; j < out.size(); ++j) {
    glm::dmat4 bind;
    for (int k = 0; k < 16; ++k) bind[k / 4][k % 4] = static_cast<double>(inverse.Float(j, k));
    out[j] *= bind;
  }
  return out;
}

bool IsSkinned(const tinygltf::Primitive& p) { return p.attributes.count("JOINTS_0") > 0; }

Status ApplyGltfSkin(const tinygltf::Model& model, const tinygltf::Primitive& p,
                     std::span<const glm::dmat4> joints, const std::string& what, Mesh* mesh,
                     std::vector<glm::dvec3>* exact) {
  TILEGRAD_ASSIGN(const auto influences, ReadInfluences(model, p, mesh->positions.size(), what));
  for (std::size_t v = 0; v < mesh->positions.size(); ++v) {
    TILEGRAD_ASSIGN(const glm::dmat4 m, MatrixOf(influences, v, joints, what));
    exact->emplace_back(m * glm::dvec4(mesh->positions[v], 1));
    mesh->positions[v] = glm::vec3(exact->back());
    if (!mesh->normals.empty()) TurnNormal(glm::dmat3(m), &mesh->normals[v]);
  }
  return {};
}

}  // namespace tilegrad::io
