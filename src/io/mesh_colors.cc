// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_colors.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include "base/error.h"

namespace tilegrad::io {
namespace {

bool IsByte(glm::vec4 color) {
  return glm::all(glm::equal(glm::vec3(color), glm::round(glm::vec3(color)))) &&
         glm::all(glm::lessThanEqual(glm::vec3(color), glm::vec3(255)));
}

// Colours are 0 to 1. Some programs write bytes as floating point, 0 to 255: whole numbers, and
// not only 0 and 1, or numbers that no light explains.
void ClampColors(std::vector<glm::vec4>* colors, std::vector<std::string>* warnings) {
  constexpr float kBrightest = 16;
  float most = 0;
  for (const glm::vec4& c : *colors) most = std::max({most, c.r, c.g, c.b});
  const bool bytes =
      most > kBrightest || (most > 1 && std::all_of(colors->begin(), colors->end(), IsByte));
  if (bytes) {
    warnings->push_back(
        fmt::format("vertex colours are numbers up to {}; taken for bytes, 0 to 255", most));
    for (glm::vec4& c : *colors) c = {glm::vec3(c) / 255.0f, c.a > 1 ? c.a / 255 : c.a};
  } else if (most > 1 + 1e-3f) {
    warnings->push_back(fmt::format("vertex colours reach {}; cut to 1", most));
  }
  for (glm::vec4& c : *colors) c = glm::clamp(c, 0.0f, 1.0f);
}

}  // namespace

void ClampColors(LoadedMesh& loaded) {
  ClampColors(&loaded.mesh.colors, &loaded.warnings);
  ClampColors(&loaded.mesh.corner_colors, &loaded.warnings);
  for (Material& material : loaded.mesh.materials) {
    const glm::vec4& c = material.base_color;
    if (std::max({c.r, c.g, c.b}) > 1 + 1e-3f) {
      loaded.warnings.push_back(fmt::format("material \"{}\": its colour ({}, {}, {}) is cut to 1",
                                            material.name, c.r, c.g, c.b));
    }
    material.base_color = glm::clamp(material.base_color, 0.0f, 1.0f);
  }
}

void WarnOfTransparentColors(LoadedMesh& loaded) {
  const auto seen = [](const auto& all, const auto& is) {
    return std::any_of(all.begin(), all.end(), is);
  };
  const auto transparent = [](const glm::vec4& color) { return color.a < 1; };
  if (!seen(loaded.mesh.colors, transparent) && !seen(loaded.mesh.corner_colors, transparent))
    return;
  if (seen(loaded.mesh.materials, [](const Material& m) {
        return m.alpha_mode != AlphaMode::kOpaque || m.base_color.a < 1;
      }))
    return;
  loaded.warnings.emplace_back("the alpha of colours is not drawn: the material is opaque");
}

}  // namespace tilegrad::io
