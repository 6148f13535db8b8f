// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <span>

#include "io/mesh_readers.h"
#include "scene/image.h"

namespace tilegrad::io {
namespace {

constexpr float kBrightest = 16;  // no light explains more

float Most(glm::vec4 color) { return std::max({color.r, color.g, color.b}); }

bool IsWhole(glm::vec4 color) {
  const glm::vec3 rgb(color);
  return glm::all(glm::equal(rgb, glm::round(rgb)));
}

// The value that means 1. Some programs write 8 or 16 bit integers as floating point: then all
// numbers are whole, and not only 0 and 1, or are brighter than any light.
float FullOf(std::span<const glm::vec4> colors, float most) {
  const bool whole = std::all_of(colors.begin(), colors.end(), IsWhole);
  if (whole && most > 255) return 65535;
  return most > kBrightest || (most > 1 && whole) ? 255 : 1;
}

glm::vec4 Finished(glm::vec4 c, float full, ColorNumbers numbers) {
  if (full > 1) c = {glm::vec3(c) / full, c.a > 1 ? c.a / full : c.a};
  c = glm::clamp(c, 0.0f, 1.0f);
  return full == 1 && numbers == ColorNumbers::kLinear ? LinearToSrgb(c) : c;
}

// Files with many parts get each warning once.
void WarnOnce(std::string_view text, std::vector<std::string>* warnings) {
  if (std::find(warnings->begin(), warnings->end(), text) == warnings->end())
    warnings->emplace_back(text);
}

// Converts a material, whose file scales colours to `full`.
void FinishMaterial(ColorNumbers numbers, float full, Material& material,
                    std::vector<std::string>* warnings) {
  const glm::vec4 c = material.base_color;
  if (Most(c) <= 1) full = 1;  // 1 is not meant as near black
  if (Most(c) > 1 + 1e-3f) {
    warnings->push_back(fmt::format("material \"{}\": its colour ({}, {}, {}) is {}", material.name,
                                    c.r, c.g, c.b, full > 1 ? "read as 0 to 255" : "cut to 1"));
  }
  material.base_color = Finished(c, full, numbers);
}

}  // namespace

bool IsFinite(const glm::vec4& color) {
  return !glm::any(glm::isnan(color)) && !glm::any(glm::isinf(color));
}

void FinishColors(ColorNumbers numbers, std::vector<glm::vec4>* colors,
                  std::vector<std::string>* warnings) {
  if (!std::all_of(colors->begin(), colors->end(), IsFinite)) return;  // Validate says so
  float most = 0;
  for (const glm::vec4& c : *colors) most = std::max(most, Most(c));
  const float full = FullOf(*colors, most);
  if (full > 1) {
    WarnOnce(fmt::format("vertex colours are read as 0 to {}", full), warnings);
  } else if (most > 1 + 1e-3f) {
    WarnOnce("vertex colours beyond 1 are cut to 1", warnings);
  }
  for (glm::vec4& c : *colors) c = c == kNoColor ? glm::vec4(1) : Finished(c, full, numbers);
}

void FinishMaterials(ColorNumbers numbers, LoadedMesh& loaded) {
  float most = 0;
  for (const Material& material : loaded.mesh.materials)
    most = std::max(most, Most(material.base_color));
  for (Material& material : loaded.mesh.materials)
    FinishMaterial(numbers, most > kBrightest ? 255 : 1, material, &loaded.warnings);
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
