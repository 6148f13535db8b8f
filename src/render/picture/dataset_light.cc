// SPDX-License-Identifier: Apache-2.0
#include "render/picture/dataset_light.h"

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace tilegrad {
namespace {

constexpr float kKey = 0.45f, kFill = 0.2f;

Light LightFrom(glm::vec3 towards, float intensity) {
  const glm::vec3 d = glm::normalize(towards);
  return {{d.x, d.y, d.z}, intensity};
}

}  // namespace

std::array<Light, 2> DatasetLights() {
  return {LightFrom({0.35f, 0.8f, 0.5f}, kKey), LightFrom({-0.6f, 0.3f, -0.75f}, kFill)};
}

Surface DatasetSurface() {
  Surface surface;
  surface.ambient.fill(kDatasetAmbient);
  surface.specular.fill(0);
  return surface;
}

}  // namespace tilegrad
