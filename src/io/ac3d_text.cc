// SPDX-License-Identifier: Apache-2.0
#include "io/ac3d_text.h"

#include <algorithm>

namespace tilegrad::io {

bool Ac3dText::Next(std::string_view& line) {
  while (lines_.Next(line)) {
    if (line.find_first_not_of(" \t\r") != std::string_view::npos) return true;
  }
  return false;
}

Status Ac3dText::Error(std::string_view what) const {
  return DataLoss("{}: line {}: {}", place_, lines_.Number(), what);
}

Result<Material> Ac3dText::ReadMaterial(std::string_view rest) {
  Material material{.name = std::string(NextAc3dString(rest)), .base_color = glm::vec4(1)};
  TILEGRAD_TRY(MaterialValues(rest, material));
  return material;
}

Result<Material> Ac3dText::ReadMaterialBlock(std::string_view rest) {
  Material material{.name = std::string(NextAc3dString(rest)), .base_color = glm::vec4(1)};
  for (std::string_view line; Next(line);) {
    if (line.starts_with("ENDMAT")) return material;
    TILEGRAD_TRY(MaterialValues(line, material));
  }
  return Error("ends before ENDMAT");
}

// "rgb 1 1 1  amb ...  trans 0", or a part of it.
Status Ac3dText::MaterialValues(std::string_view rest, Material& material) {
  for (auto key = NextToken(rest); !key.empty(); key = NextToken(rest)) {
    if (key == "rgb") TILEGRAD_TRY(Numbers(rest, &material.base_color[0], 3, "rgb"));
    if (key == "emis") {
      glm::vec3 light(0);
      TILEGRAD_TRY(Numbers(rest, &light[0], 3, "emis"));
      emits_ = emits_ || light != glm::vec3(0);
    }
    if (key != "trans") continue;
    float transparency = 0;
    TILEGRAD_TRY(Numbers(rest, &transparency, 1, "trans"));
    material.base_color.a = 1 - transparency;
  }
  return {};
}

std::string_view NextAc3dString(std::string_view& rest) {
  const auto begin = rest.find_first_not_of(" \t");
  if (begin == std::string_view::npos || rest[begin] != '"') return NextToken(rest);
  const auto end = std::min(rest.find('"', begin + 1), rest.size());
  const auto text = rest.substr(begin + 1, end - begin - 1);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return text;
}

}  // namespace tilegrad::io
