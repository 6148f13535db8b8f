// SPDX-License-Identifier: Apache-2.0
// The Laplacian regulariser of section 4.1, on the movement m of the vertices: sum over
// vertices and axes of (mean of the neighbours' m - m)^2, mean over the batch. Uniform one-ring
// weights.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "scene/mesh.h"
#include "scene/topology.h"

namespace tilegrad::train {

// One mesh: m [V,3]. Fills residual [V,3] with L m, (L m)_i = mean_{j in N(i)} m_j - m_i; 0 for a
// vertex without neighbours. Returns the sum of squares, in double.
template <class T>
double LaplacianForward(const Topology& topology, std::span<const T> m, std::span<T> residual) {
  double sum = 0;
  for (std::size_t v = 0; v + 1 < topology.offsets.size(); ++v) {
    const std::int32_t begin = topology.offsets[v], end = topology.offsets[v + 1];
    for (std::size_t c = 0; c < 3; ++c) {
      T mean = 0;
      for (std::int32_t n = begin; n < end; ++n) mean += m[3 * topology.neighbors[n] + c];
      const T r = end > begin ? mean / T(end - begin) - m[3 * v + c] : T(0);
      residual[3 * v + c] = r;
      sum += static_cast<double>(r) * static_cast<double>(r);
    }
  }
  return sum;
}

// d_m = 2 scale L^T residual, written as a gather: (L^T r)_i = sum_{j in N(i)} r_j / deg(j) - r_i.
template <class T>
void LaplacianBackward(const Topology& topology, std::span<const T> residual, T scale,
                       std::span<T> d_m) {
  std::vector<T> shares(residual.size());  // r_j / deg(j)
  for (std::size_t v = 0; v + 1 < topology.offsets.size(); ++v) {
    const T degree = T(topology.offsets[v + 1] - topology.offsets[v]);
    for (std::size_t c = 0; c < 3; ++c) shares[3 * v + c] = residual[3 * v + c] / degree;
  }
  for (std::size_t v = 0; v + 1 < topology.offsets.size(); ++v) {
    for (std::size_t c = 0; c < 3; ++c) {
      T sum = -residual[3 * v + c];
      for (std::int32_t n = topology.offsets[v]; n < topology.offsets[v + 1]; ++n)
        sum += shares[3 * topology.neighbors[n] + c];
      d_m[3 * v + c] = 2 * scale * sum;
    }
  }
}

// movement: [B, V, 3]. A scalar.
nn::Var LaplacianLoss(const nn::Var& movement, const Topology& topology);

// CMR's regulariser of shapes: the mean over vertices of |L v|, with L by cotangents (Pinkall and
// Polthier, 1993):
//
//   (L v)_i = sum_j w_ij (v_j - v_i),   w_ij = (cot alpha + cot beta) / 2
//
// alpha and beta are the angles opposite the edge ij. As in CMR's code, the weights are those of
// the initial mesh and stay fixed.

// Cotangents are clamped here, so that those of slivers stay finite.
inline constexpr double kMostCotangent = 20;

struct WeighedEdge {
  std::int32_t i, j;
  double weight;
};

// For a mesh with `positions` [V,3]: an entry for each corner of a face, for the opposite edge ij.
std::vector<WeighedEdge> CotangentWeights(std::span<const Face> faces,
                                          std::span<const double> positions);

// Adds L v of v [V,3] to out [V,3].
template <class T>
void AddLaplacian(std::span<const WeighedEdge> edges, std::span<const T> v, std::span<T> out) {
  for (const auto& [i, j, weight] : edges) {
    for (int c = 0; c < 3; ++c) {
      const auto a = static_cast<std::size_t>(3 * i + c), b = static_cast<std::size_t>(3 * j + c);
      const T difference = static_cast<T>(weight) * (v[b] - v[a]);
      out[a] += difference;
      out[b] -= difference;
    }
  }
}

// positions: [B, V, 3]. A scalar, the mean over the batch, too. A vertex with L v = 0 contributes
// no gradient.
nn::Var CotangentLaplacianLoss(const nn::Var& positions, std::span<const WeighedEdge> edges);

}  // namespace tilegrad::train
