// SPDX-License-Identifier: Apache-2.0
#include "scene/subdivide.h"

#include <algorithm>
#include <map>
#include <utility>

namespace tilegrad {

std::vector<Face> SplitFaces(const std::vector<Face>& faces,
                             FunctionRef<std::int32_t(std::int32_t a, std::int32_t b)> middle) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> known;
  const auto between = [&](std::int32_t a, std::int32_t b) {
    const std::pair<std::int32_t, std::int32_t> edge = std::minmax(a, b);
    const auto at = known.find(edge);
    if (at != known.end()) return at->second;
    return known[edge] = middle(edge.first, edge.second);
  };
  std::vector<Face> out;
  out.reserve(faces.size() * 4);
  for (const auto& [a, b, c] : faces) {
    const std::int32_t ab = between(a, b), bc = between(b, c), ca = between(c, a);
    out.insert(out.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
  }
  return out;
}

namespace {

// In the order of SplitFaces.
std::vector<glm::vec2> SplitCorners(const std::vector<glm::vec2>& uvs) {
  std::vector<glm::vec2> out;
  out.reserve(uvs.size() * 4);
  for (std::size_t i = 0; i < uvs.size(); i += 3) {
    const glm::vec2 a = uvs[i], b = uvs[i + 1], c = uvs[i + 2];
    const glm::vec2 ab = 0.5f * (a + b), bc = 0.5f * (b + c), ca = 0.5f * (c + a);
    out.insert(out.end(), {a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca});
  }
  return out;
}

}  // namespace

Mesh Subdivided(const Mesh& mesh) {
  Mesh out;
  out.positions = mesh.positions;
  out.colors = mesh.colors;
  if (mesh.materials.size() == 1) {
    out.corner_uvs = SplitCorners(mesh.corner_uvs);
    out.materials = mesh.materials;
    out.textures = mesh.textures;
  }
  out.faces = SplitFaces(mesh.faces, [&](std::int32_t a, std::int32_t b) {
    const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
    out.positions.push_back(0.5f * (out.positions[i] + out.positions[j]));
    if (!out.colors.empty()) out.colors.push_back(0.5f * (out.colors[i] + out.colors[j]));
    return static_cast<std::int32_t>(out.positions.size() - 1);
  });
  return out;
}

}  // namespace tilegrad
