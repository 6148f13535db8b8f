// SPDX-License-Identifier: Apache-2.0
// CMR's regulariser of shapes: the mean over vertices of |L v|, with L by cotangents (Pinkall and
// Polthier, 1993):
//
//   (L v)_i = sum_j w_ij (v_j - v_i),   w_ij = (cot alpha + cot beta) / 2
//
// alpha and beta are the angles opposite the edge ij. As in CMR's code, weights are those of one
// mesh, from which learning starts, and stay.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "scene/mesh.h"

namespace tilegrad::train {

// Cotangents are cut here, so that those of slivers are finite.
inline constexpr double kMostCotangent = 20;

struct WeighedEdge {
  std::int32_t i, j;
  double weight;
};
// Of a mesh with `positions` [V,3]: an entry for each corner of a face, opposite edges ij.
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

// positions: [B, V, 3]. A scalar, the mean over the batch, too. The gradient of a vertex whose L v
// is 0 is 0.
nn::Var CotangentLaplacianLoss(const nn::Var& positions, std::span<const WeighedEdge> edges);

}  // namespace tilegrad::train
