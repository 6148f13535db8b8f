// SPDX-License-Identifier: Apache-2.0
// The surface colour of a mesh: combines material, texture and vertex colours.
#pragma once

#include <vector>

#include "scene/mesh.h"
#include "tilegrad/scene.h"

namespace tilegrad::shade {

inline constexpr int kMaxTextureSide = 512;  // texels; larger textures are halved until they fit

// The wrap mode of the material's texture.
Wrap WrapOf(const Material& material);

// Keeps a reference to the mesh.
class SurfaceColor {
 public:
  explicit SurfaceColor(const Mesh& mesh);

  // Unlit RGB in [0, 1] at a point of a face: factor x texture (bilinear) x `vertex_color`.
  glm::vec3 At(std::size_t face, glm::vec2 uv, glm::vec3 vertex_color) const;
  // At corner k of a face.
  glm::vec3 AtCorner(std::size_t face, int k) const;

  std::size_t material(std::size_t face) const {
    return mesh_.face_materials.empty() ? 0 : static_cast<std::size_t>(mesh_.face_materials[face]);
  }

 private:
  struct Texels {
    int width = 0, height = 0;
    std::vector<float> rgb;
  };
  static Texels Prepare(const ImageU8& image);

  const Mesh& mesh_;
  std::vector<Texels> textures_;
};

}  // namespace tilegrad::shade
