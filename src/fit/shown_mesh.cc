// SPDX-License-Identifier: Apache-2.0
#include "fit/shown_mesh.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

namespace tilegrad::train {
namespace {

constexpr int kMostReach = 6;

// The sum of texels up to `reach` away from the nearest; their number in alpha.
glm::vec4 TexelsAround(const Image& texture, float u, float v, int reach) {
  const auto texel = [](float unit, int count) {
    return std::clamp(static_cast<int>(unit * static_cast<float>(count)), 0, count - 1);
  };
  const int x = texel(u, texture.width), y = texel(1 - v, texture.height);
  glm::vec4 sum(0);
  for (int i = std::max(0, y - reach); i <= std::min(texture.height - 1, y + reach); ++i) {
    for (int j = std::max(0, x - reach); j <= std::min(texture.width - 1, x + reach); ++j) {
      const float* rgb = texture.at(j, i);
      sum += glm::vec4(rgb[0], rgb[1], rgb[2], 1);
    }
  }
  return sum;
}

// About as many texels as there are for each vertex.
int ReachOf(const Image& texture, std::size_t vertices) {
  const double each = static_cast<double>(texture.width) * texture.height /
                      static_cast<double>(std::max<std::size_t>(vertices, 1));
  return std::clamp(static_cast<int>(std::sqrt(each) / 2), 0, kMostReach);
}

// Means over the corners of each vertex.
std::vector<glm::vec4> ColorsOfTexture(const FitScene& scene, std::size_t vertices) {
  std::vector<glm::vec4> colors(vertices, glm::vec4(0));
  const int reach = ReachOf(scene.texture, vertices);
  for (std::size_t c = 0; c < scene.uv_indices.size(); ++c) {
    const auto at = 2 * static_cast<std::size_t>(scene.uv_indices[c]);
    colors[static_cast<std::size_t>(scene.faces[c])] +=
        TexelsAround(scene.texture, scene.uvs[at], scene.uvs[at + 1], reach);
  }
  for (glm::vec4& color : colors) color = color.a > 0 ? color / color.a : glm::vec4(1);
  return colors;
}

}  // namespace

Mesh ShownMesh(const FitScene& scene) {
  Mesh mesh;
  for (std::size_t v = 0; v + 2 < scene.positions.size(); v += 3)
    mesh.positions.emplace_back(scene.positions[v], scene.positions[v + 1], scene.positions[v + 2]);
  for (std::size_t f = 0; f + 2 < scene.faces.size(); f += 3)
    mesh.faces.push_back({scene.faces[f], scene.faces[f + 1], scene.faces[f + 2]});
  if (!scene.texture.empty() && scene.uv_indices.size() == scene.faces.size()) {
    mesh.colors = ColorsOfTexture(scene, mesh.positions.size());
  } else {
    for (std::size_t v = 0; v + 2 < scene.colors.size(); v += 3)
      mesh.colors.emplace_back(scene.colors[v], scene.colors[v + 1], scene.colors[v + 2], 1);
  }
  for (glm::vec4& color : mesh.colors) color = glm::clamp(color, 0.0f, 1.0f);
  return mesh;
}

}  // namespace tilegrad::train
