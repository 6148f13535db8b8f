// SPDX-License-Identifier: Apache-2.0
#include "train/models/textured_mesh.h"

#include <algorithm>

#include "render/picture/composite.h"

namespace tilegrad::train {

Mesh DeformedMesh(const TexturedTemplate& from, std::span<const float> p,
                  std::span<const float> texels) {
  Mesh mesh;
  mesh.faces = from.sphere.mesh().faces;
  for (std::size_t i = 0; i < p.size(); i += 3)
    mesh.positions.emplace_back(p[i], p[i + 1], p[i + 2]);
  mesh.corner_uvs = from.sphere.corner_uvs();
  ImageU8 image(from.texture_size, from.texture_size, 3);
  std::ranges::transform(texels, image.pixels.begin(), ToByte);
  mesh.textures = {{"predicted", std::move(image)}};
  mesh.materials = {{.name = "predicted",
                     .base_color = glm::vec4(1),
                     .base_color_texture = 0,
                     .wrap = {TextureWrap::kRepeat, TextureWrap::kClamp}}};
  return mesh;
}

}  // namespace tilegrad::train
