// SPDX-License-Identifier: Apache-2.0
#include "train/models/prediction.h"

#include <algorithm>

#include "base/error.h"
#include "render/picture/composite.h"

namespace tilegrad::train {
namespace {

void AddTexture(const SphereModel& sphere, const Prediction& prediction, std::size_t i,
                Mesh* mesh) {
  const auto size = static_cast<int>(prediction.textures.shape()[1]);
  ImageU8 image(size, size, 3);
  std::ranges::transform(ItemOf(prediction.textures, i), image.pixels.begin(), ToByte);
  mesh->corner_uvs = sphere.corner_uvs();
  mesh->textures = {{"predicted", std::move(image)}};
  mesh->materials = {{.name = "predicted",
                      .base_color = glm::vec4(1),
                      .base_color_texture = 0,
                      .wrap = {TextureWrap::kRepeat, TextureWrap::kClamp}}};
}

void AddColors(std::span<const float> c, Mesh* mesh) {
  const auto unit = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  for (std::size_t i = 0; i < c.size(); i += 3)
    mesh->colors.emplace_back(unit(c[i]), unit(c[i + 1]), unit(c[i + 2]), 1.0f);
}

}  // namespace

Result<Mesh> MeshOf(const SphereModel& sphere, const Prediction& prediction, std::size_t i) {
  Mesh mesh;
  mesh.faces = sphere.mesh().faces;
  const std::span<const float> p = ItemOf(prediction.positions, i);
  for (std::size_t v = 0; v < p.size(); v += 3)
    mesh.positions.emplace_back(p[v], p[v + 1], p[v + 2]);
  if (prediction.textures.valid()) AddTexture(sphere, prediction, i, &mesh);
  if (prediction.colors.valid()) AddColors(ItemOf(prediction.colors, i), &mesh);
  if (const Status valid = Validate(mesh); !valid.ok())
    return InternalError("the prediction is invalid: {}", valid.message());
  return mesh;
}

nn::Tensor InputOf(nn::Context& context, std::span<const std::uint8_t> images, int size) {
  const auto count = static_cast<std::int64_t>(images.size()) / (4 * size * size);
  nn::Tensor input = context.Empty({count, 4, size, size});
  std::ranges::transform(images, input.data<float>(),
                         [](std::uint8_t b) { return static_cast<float>(b) / 255; });
  return input;
}

}  // namespace tilegrad::train
