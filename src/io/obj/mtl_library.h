// SPDX-License-Identifier: Apache-2.0
// Internal to io: the material libraries of OBJ files.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad::io {

// An image on a material: uv * scale + offset says where in it.
struct MtlImage {
  std::string name;  // empty: none
  glm::vec2 scale{1}, offset{0};
  bool clamp = false;
  bool operator==(const MtlImage&) const = default;
};

struct MtlMaterial {
  std::string name;
  glm::vec3 diffuse{1};  // Kd; white where the file has none
  float opacity = 1;     // d, else 1 - Tr
  MtlImage image{};      // map_Kd
  bool operator==(const MtlMaterial&) const = default;
};

struct MtlLibrary {
  std::vector<MtlMaterial> materials;           // in the order of the file
  std::set<std::string, std::less<>> not_read;  // statements and options that change what is drawn
};

// DataLoss names `place` and the line: a number that is not finite.
Result<MtlLibrary> ParseMtl(std::string_view text, const std::string& place);

}  // namespace tilegrad::io
