// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/wheels.h"

#include <glm/geometric.hpp>

#include "io/text_scan.h"
#include "scene/shapes.h"

namespace tilegrad::train {
namespace {

constexpr int kSegments = 24;
constexpr glm::vec4 kTyre = {0.09f, 0.09f, 0.1f, 1}, kRim = {0.62f, 0.62f, 0.64f, 1};
constexpr float kRimRadius = 0.62f, kRimWidth = 1.03f;  // of the tyre's

// A disc about y, coloured.
Mesh Disc(float radius, float width, glm::vec4 color) {
  Mesh disc = Frustum(glm::vec3(0), radius, radius, width, kSegments);
  disc.materials = {Material{.name = "wheel", .base_color = glm::vec4(1)}};
  SetColor(disc, color);
  return disc;
}

}  // namespace

Result<std::vector<Wheel>> ReadWheels(std::string_view text) {
  std::vector<Wheel> wheels;
  while (!text.empty()) {
    std::string_view part = text.substr(0, text.find('|'));
    text.remove_prefix(std::min(text.size(), part.size() + 1));
    Wheel wheel;
    for (float* value :
         {&wheel.centre.x, &wheel.centre.y, &wheel.centre.z, &wheel.radius, &wheel.width}) {
      if (!io::ParseNumber(io::NextToken(part), *value))
        return InvalidArgument("a wheel needs five numbers: x y z radius width");
    }
    wheels.push_back(wheel);
  }
  return wheels;
}

void AddWheel(const Wheel& wheel, glm::vec3 axle, Mesh* mesh) {
  Mesh both = Disc(wheel.radius, wheel.width, kTyre);
  Append(both, Disc(kRimRadius * wheel.radius, kRimWidth * wheel.width, kRim));
  const glm::vec3 side = std::abs(axle.x) > 0.5f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0);
  Transform(both, {side, axle, glm::cross(side, axle)}, wheel.centre);
  Append(*mesh, both);
}

}  // namespace tilegrad::train
