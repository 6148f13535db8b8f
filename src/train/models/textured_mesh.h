// SPDX-License-Identifier: Apache-2.0
// A deformed sphere with its map as a mesh for files and pictures.
#pragma once

#include <span>
#include <vector>

#include "nn/nn.h"
#include "scene/mesh.h"

namespace tilegrad::train {

// A sphere to be deformed, with its texture coordinates; textures are square.
struct TexturedTemplate {
  const Mesh& mesh;
  const std::vector<glm::vec2>& corner_uvs;
  int texture_size;
};
// With these positions [V, 3] and texels [size, size, 3] in [0, 1].
Mesh DeformedMesh(const TexturedTemplate& sphere, std::span<const float> positions,
                  std::span<const float> texels);

// Item i of a batch [B, ...].
inline std::span<const float> ItemOf(const nn::Var& batch, std::size_t i) {
  const std::span<const float> all = batch.value().span<float>();
  const std::size_t size = all.size() / static_cast<std::size_t>(batch.shape()[0]);
  return all.subspan(i * size, size);
}

}  // namespace tilegrad::train
