// SPDX-License-Identifier: Apache-2.0
// The area of a mesh's surface. A face with n = (b - a) x (c - a) has the area |n| / 2, and
// dA/da = n / |n| x (c - b) / 2, and so on around.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>

#include "nn/tape.h"
#include "scene/mesh.h"

namespace tilegrad::train {

// Returns the area of one mesh, p [V,3], in squared world units; d_p += scale times its gradient,
// unless d_p is empty. Sums in double. A face without area has no gradient.
template <class T>
double AddAreaGradient(std::span<const Face> faces, std::span<const T> p, double scale,
                       std::span<T> d_p) {
  const auto corner = [&](std::int32_t vertex) {
    const T* at = &p[3 * static_cast<std::size_t>(vertex)];
    return glm::dvec3(at[0], at[1], at[2]);
  };
  double sum = 0;
  for (const Face& f : faces) {
    const glm::dvec3 corners[] = {corner(f[0]), corner(f[1]), corner(f[2])};
    const glm::dvec3 n = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    const double length = glm::length(n);
    if (!(length > 0)) continue;
    sum += 0.5 * length;
    for (std::size_t k = 0; k < 3 && !d_p.empty(); ++k) {
      const glm::dvec3 side = corners[(k + 2) % 3] - corners[(k + 1) % 3];
      const glm::dvec3 d = 0.5 * scale / length * glm::cross(n, side);
      T* const to = &d_p[3 * static_cast<std::size_t>(f[k])];
      for (int c = 0; c < 3; ++c) to[c] += static_cast<T>(d[c]);
    }
  }
  return sum;
}

inline double SurfaceArea(std::span<const Face> faces, std::span<const float> p) {
  return AddAreaGradient<float>(faces, p, 0, {});
}

// positions: [B, V, 3]. A scalar, the mean over the batch.
nn::Var AreaLoss(const nn::Var& positions, std::span<const Face> faces);

}  // namespace tilegrad::train
