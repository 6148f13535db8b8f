// SPDX-License-Identifier: Apache-2.0
// Internal to io: what a glTF material's surface is coloured by.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <string>

#include "io/gltf/gltf_model.h"

namespace tilegrad::io {

// Where a texture is looked up: the uv set, and KHR_texture_transform on it, in glTF's own
// coordinates (v down).
struct GltfUvUse {
  int set = 0;
  glm::dvec2 offset{0}, scale{1};
  double rotation = 0;  // radians

  std::string Key() const;  // the attribute
  glm::vec2 operator()(glm::vec2 uv) const;
};

// The base colour, or the diffuse colour of KHR_materials_pbrSpecularGlossiness, which comes first
// where a file has both.
struct GltfBaseColor {
  glm::dvec4 factor{1};  // linear
  int texture = -1;
  GltfUvUse uv;
};

// Of a material that does not exist: glTF's default, white.
GltfBaseColor GltfBaseColorOf(const tinygltf::Model& model, int material);

}  // namespace tilegrad::io
