// SPDX-License-Identifier: Apache-2.0
#include "train/losses/cotangent_laplacian.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "train/losses/mesh_batch.h"

namespace tilegrad::train {
namespace {

// cot of the angle at a between b and c: dot / |cross|.
template <class T>
T Cotangent(const T* a, const T* b, const T* c) {
  const T u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const T v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const T dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const T n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  const T cross = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  const T most = T(kMostCotangent);
  if (!(std::abs(dot) < most * cross)) return dot < T(0) ? -most : most;
  return dot / cross;
}

}  // namespace

template <class T>
void AddCotangentLaplacian(std::span<const Face> faces, std::span<const T> p, std::span<const T> v,
                           std::span<T> out) {
  for (const Face& face : faces) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto a = static_cast<std::size_t>(face[corner]),
                 i = static_cast<std::size_t>(face[(corner + 1) % 3]),
                 j = static_cast<std::size_t>(face[(corner + 2) % 3]);
      const T weight = Cotangent(&p[3 * a], &p[3 * i], &p[3 * j]) / T(2);
      for (std::size_t c = 0; c < 3; ++c) {
        const T difference = weight * (v[3 * j + c] - v[3 * i + c]);
        out[3 * i + c] += difference;
        out[3 * j + c] -= difference;
      }
    }
  }
}

template void AddCotangentLaplacian(std::span<const Face>, std::span<const float>,
                                    std::span<const float>, std::span<float>);
template void AddCotangentLaplacian(std::span<const Face>, std::span<const double>,
                                    std::span<const double>, std::span<double>);

// L is symmetric, so the gradient is L applied to the unit vectors of L v.
nn::Var CotangentLaplacianLoss(const nn::Var& positions, std::span<const Face> faces) {
  return MeshLoss("cotangent laplacian", positions,
                  [&]<class T>(std::span<const T> p, T scale, std::span<T> d) {
                    std::vector<T> residual(p.size(), T(0));
                    AddCotangentLaplacian<T>(faces, p, p, residual);
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
                    AddCotangentLaplacian<T>(faces, p, residual, d);
                    return sum / static_cast<double>(vertices);
                  });
}

}  // namespace tilegrad::train
