// SPDX-License-Identifier: Apache-2.0
#include "train/losses/cotangent_laplacian.h"

#include <algorithm>
#include <cmath>

#include "train/losses/mesh_batch.h"

namespace tilegrad::train {
namespace {

// cot of the angle at a between b and c: dot / |cross|.
double Cotangent(const double* a, const double* b, const double* c) {
  const double u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const double v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const double dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const double cross =
      std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  if (!(std::abs(dot) < kMostCotangent * cross)) return dot < 0 ? -kMostCotangent : kMostCotangent;
  return dot / cross;
}

}  // namespace

std::vector<WeighedEdge> CotangentWeights(std::span<const Face> faces,
                                          std::span<const double> positions) {
  std::vector<WeighedEdge> out;
  for (const Face& face : faces) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::int32_t a = face[corner], i = face[(corner + 1) % 3], j = face[(corner + 2) % 3];
      const double* const p = positions.data();
      out.push_back({i, j, Cotangent(p + 3 * a, p + 3 * i, p + 3 * j) / 2});
    }
  }
  return out;
}

// L is symmetric, so the gradient is L applied to the unit vectors of L v.
nn::Var CotangentLaplacianLoss(const nn::Var& positions, std::span<const WeighedEdge> edges) {
  return MeshLoss("cotangent laplacian", positions,
                  [&]<class T>(std::span<const T> p, T scale, std::span<T> d) {
                    std::vector<T> residual(p.size(), T(0));
                    AddLaplacian<T>(edges, p, residual);
                    const std::size_t vertices = p.size() / 3;
                    double sum = 0;
                    for (std::size_t v = 0; v < vertices; ++v) {
                      T* const r = &residual[3 * v];
                      const T length = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
                      sum += static_cast<double>(length);
                      const T unit = length > T(0) ? scale / (length * T(vertices)) : T(0);
                      for (std::size_t c = 0; c < 3; ++c) r[c] *= unit;
                    }
                    std::ranges::fill(d, T(0));
                    AddLaplacian<T>(edges, residual, d);
                    return sum / static_cast<double>(vertices);
                  });
}

}  // namespace tilegrad::train
