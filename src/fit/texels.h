// SPDX-License-Identifier: Apache-2.0
// Where texture coordinates lie among the texels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>

#include "fit/scene.h"

namespace tilegrad::train {

// Of one pair of texture coordinates, in texels: centres are at whole numbers, row 0 is v = 1.
inline glm::dvec2 TexelAt(const FitScene& scene, std::int32_t uv) {
  const auto at = 2 * static_cast<std::size_t>(uv);
  return {static_cast<double>(scene.uvs[at]) * scene.texture.width - 0.5,
          (1 - static_cast<double>(scene.uvs[at + 1])) * scene.texture.height - 0.5};
}

inline double Cross(glm::dvec2 a, glm::dvec2 b) { return a.x * b.y - a.y * b.x; }

}  // namespace tilegrad::train
