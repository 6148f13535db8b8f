// SPDX-License-Identifier: Apache-2.0
// The edge-length regulariser: the variance of the lengths of a mesh's edges over the square of
// their mean, n sum l^2 / (sum l)^2 - 1. 0 where all are equal; the size of the mesh does not
// matter, so it never shrinks it.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "scene/topology.h"

namespace tilegrad::train {

template <class T>
struct EdgeSums {
  T length = 0, square = 0;  // over all edges
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
T EdgeLengthForward(const Topology& topology, std::span<const T> p, EdgeSums<T>* sums) {
  *sums = {};
  for (const Edge& e : topology.edges) {
    const T length = EdgeLength(p, e);
    sums->length += length, sums->square += length * length;
  }
  if (!(sums->length > T(0))) return T(0);
  return T(topology.edges.size()) * sums->square / (sums->length * sums->length) - T(1);
}

// d_p += scale times the gradient: dL/dl = 2 n (l - square / length) / length^2. An edge without
// length has no direction and pulls nothing.
template <class T>
void AddEdgeLengthGradient(const Topology& topology, std::span<const T> p, const EdgeSums<T>& sums,
                           T scale, std::span<T> d_p) {
  if (!(sums.length > T(0))) return;
  const T factor = 2 * scale * T(topology.edges.size()) / (sums.length * sums.length);
  for (const Edge& e : topology.edges) {
    const T length = EdgeLength(p, e);
    if (!(length > T(0))) continue;
    const T along = factor * (length - sums.square / sums.length) / length;
    for (std::int32_t c = 0; c < 3; ++c) {
      const T d = along * (p[3 * e.b + c] - p[3 * e.a + c]);
      d_p[3 * e.b + c] += d, d_p[3 * e.a + c] -= d;
    }
  }
}

}  // namespace tilegrad::train
