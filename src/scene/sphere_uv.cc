// SPDX-License-Identifier: Apache-2.0
#include "scene/sphere_uv.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace tilegrad {
namespace {

struct CornerUv {
  float u, v;
  bool pole;
};

CornerUv UvOf(glm::vec3 p) {
  const double radius = std::sqrt(static_cast<double>(p.x) * p.x + static_cast<double>(p.y) * p.y +
                                  static_cast<double>(p.z) * p.z);
  const double u = 0.5 + std::atan2(-static_cast<double>(p.z), static_cast<double>(p.x)) /
                             (2 * std::numbers::pi);
  const double v = 0.5 + std::asin(std::clamp(p.y / radius, -1.0, 1.0)) / std::numbers::pi;
  return {static_cast<float>(u), static_cast<float>(v),
          std::hypot(p.x, p.z) < 1e-6f * static_cast<float>(radius)};
}

// Corners of one face, all on one side of the seam.
void Unwrap(std::array<CornerUv, 3>* corners) {
  float largest = 0, sum = 0;
  int others = 0;
  for (const CornerUv& c : *corners) {
    if (!c.pole) largest = std::max(largest, c.u);
  }
  for (CornerUv& c : *corners) {
    if (c.pole) continue;
    if (largest - c.u > 0.5f) c.u += 1;
    sum += c.u, ++others;
  }
  for (CornerUv& c : *corners) {
    if (c.pole && others > 0) c.u = sum / static_cast<float>(others);
  }
}

}  // namespace

std::vector<glm::vec2> SphereUvs(const Mesh& sphere) {
  std::vector<glm::vec2> uvs;
  uvs.reserve(3 * sphere.faces.size());
  for (const Face& face : sphere.faces) {
    std::array<CornerUv, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = UvOf(sphere.positions[static_cast<std::size_t>(face[k])]);
    }
    Unwrap(&corners);
    for (const CornerUv& c : corners) uvs.emplace_back(c.u, c.v);
  }
  return uvs;
}

}  // namespace tilegrad
