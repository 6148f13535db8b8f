// SPDX-License-Identifier: Apache-2.0
// The Laplacian regulariser of section 4.1, on the movement m of the vertices: sum over
// vertices and axes of (mean of the neighbours' m - m)^2, mean over the batch. Uniform one-ring
// weights.
#pragma once

#include <span>
#include <vector>

#include "nn/tape.h"
#include "scene/topology.h"

namespace tilegrad::train {

// One mesh: m [V,3]. residual [V,3] is filled with L m, with (L m)_i = mean_{j in N(i)} m_j - m_i;
// a vertex without neighbours has 0. Returns the sum of squares, taken in double.
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
      for (std::int32_t n = topology.offsets[v]; n < topology.offsets[v + 1]; ++n) {
        sum += shares[3 * topology.neighbors[n] + c];
      }
      d_m[3 * v + c] = 2 * scale * sum;
    }
  }
}

// movement: [B, V, 3]. A scalar.
nn::Var LaplacianLoss(const nn::Var& movement, const Topology& topology);

}  // namespace tilegrad::train
