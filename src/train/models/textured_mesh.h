// SPDX-License-Identifier: Apache-2.0
// A deformed sphere with its map as a mesh for files and pictures.
#pragma once

#include <span>
#include <vector>

#include "nn/nn.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train {

// Textures are square.
struct TexturedTemplate {
  const SphereModel& sphere;
  int texture_size;
};
// With these positions [V, 3] and texels [size, size, 3] in [0, 1].
Mesh DeformedMesh(const TexturedTemplate& from, std::span<const float> positions,
                  std::span<const float> texels);

// Item i of a batch [B, ...].
inline std::span<const float> ItemOf(const nn::Var& batch, std::size_t i) {
  const std::span<const float> all = batch.value().span<float>();
  const std::size_t size = all.size() / static_cast<std::size_t>(batch.shape()[0]);
  return all.subspan(i * size, size);
}

}  // namespace tilegrad::train
