// SPDX-License-Identifier: Apache-2.0
// The edge-length regulariser: the variance of the lengths of a mesh's edges over the square of
// their mean, n sum l^2 / (sum l)^2 - 1. 0 where all are equal; the size of the mesh does not
// matter, so it never shrinks it.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "nn/tape.h"
#include "scene/topology.h"

namespace tilegrad::train {

// Over all edges; in double, since the loss is what little remains of their quotient.
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

// d_p += scale times the gradient: dL/dl = 2 n (l - square / length) / length^2. An edge without
// length has no direction and pulls nothing.
template <class T>
void AddEdgeLengthGradient(const Topology& topology, std::span<const T> p, const EdgeSums& sums,
                           T scale, std::span<T> d_p) {
  if (!(sums.length > 0)) return;
  const double factor = 2 * static_cast<double>(scale) *
                        static_cast<double>(topology.edges.size()) / (sums.length * sums.length);
  const double balance = sums.square / sums.length;  // an edge of this length is left alone
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
