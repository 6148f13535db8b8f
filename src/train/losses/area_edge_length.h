// SPDX-License-Identifier: Apache-2.0
// Regularisers of a mesh's area and of its edge lengths.
//
// A face with n = (b - a) x (c - a) has the area |n| / 2, and dA/da = n / |n| x (c - b) / 2, and
// cyclically for b and c. Edge lengths: their variance over the square of their mean,
// n sum l^2 / (sum l)^2 - 1, is 0 if all are equal; independent of the mesh's size, so it never
// shrinks it.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>

#include "nn/tape.h"
#include "scene/mesh.h"
#include "scene/topology.h"

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

// Over all edges; in double, because the loss is the small difference of their quotient from 1.
struct EdgeSums {
  double length = 0, square = 0;
};

template <class T>
T EdgeLength(std::span<const T> p, const Edge& e) {
  T square = 0;
  for (std::int32_t c = 0; c < 3; ++c) {
    const T d = p[3 * e.b + c] - p[3 * e.a + c];
    square += d * d;
  }
  return std::sqrt(square);
}

// One mesh: p [V,3]. 0 for a mesh without edges or extent.
template <class T>
double EdgeLengthForward(const Topology& topology, std::span<const T> p, EdgeSums* sums) {
  *sums = {};
  for (const Edge& e : topology.edges) {
    const double length = static_cast<double>(EdgeLength(p, e));
    sums->length += length;
    sums->square += length * length;
  }
  if (!(sums->length > 0)) return 0;
  const auto edges = static_cast<double>(topology.edges.size());
  return edges * sums->square / (sums->length * sums->length) - 1;
}

// d_p += scale times the gradient: dL/dl = 2 n (l - square / length) / length^2. An edge of length
// 0 has no direction and no gradient.
template <class T>
void AddEdgeLengthGradient(const Topology& topology, std::span<const T> p, const EdgeSums& sums,
                           T scale, std::span<T> d_p) {
  if (!(sums.length > 0)) return;
  const double factor = 2 * static_cast<double>(scale) *
                        static_cast<double>(topology.edges.size()) / (sums.length * sums.length);
  const double balance = sums.square / sums.length;  // an edge of this length has no gradient
  for (const Edge& e : topology.edges) {
    const T length = EdgeLength(p, e);
    if (!(length > T(0))) continue;
    const T along = static_cast<T>(factor * (static_cast<double>(length) - balance)) / length;
    for (std::int32_t c = 0; c < 3; ++c) {
      const T d = along * (p[3 * e.b + c] - p[3 * e.a + c]);
      d_p[3 * e.b + c] += d;
      d_p[3 * e.a + c] -= d;
    }
  }
}

// positions: [B, V, 3]. A scalar, the mean over the batch.
nn::Var EdgeLengthLoss(const nn::Var& positions, const Topology& topology);

}  // namespace tilegrad::train
