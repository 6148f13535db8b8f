// SPDX-License-Identifier: Apache-2.0
#include "fit/sphere_uv.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace tilegrad::train {
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

void SetSphereUv(const Mesh& sphere, FitScene* scene) {
  scene->uvs.clear(), scene->uv_indices.clear();
  std::map<std::pair<std::int32_t, float>, std::int32_t> known;
  for (const Face& face : sphere.faces) {
    std::array<CornerUv, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = UvOf(sphere.positions[static_cast<std::size_t>(face[k])]);
    }
    Unwrap(&corners);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [at, added] = known.try_emplace({face[k], corners[k].u},
                                                 static_cast<std::int32_t>(scene->uvs.size() / 2));
      if (added) scene->uvs.insert(scene->uvs.end(), {corners[k].u, corners[k].v});
      scene->uv_indices.push_back(at->second);
    }
  }
}

}  // namespace tilegrad::train
