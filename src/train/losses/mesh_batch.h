// SPDX-License-Identifier: Apache-2.0
// A regulariser over a batch of meshes: meshes in parallel, sums merged in order.
#pragma once

#include <vector>

#include "train/losses/scalar_loss.h"

namespace tilegrad::train {

// per_mesh(values [V,3], scale, d [V,3]) -> the loss of one mesh; the result is the mean.
template <class PerMesh>
nn::Var MeshLoss(const char* name, const nn::Var& x, PerMesh per_mesh) {
  if (!x.valid()) return x;
  nn::Context& context = x.context();
  nn::Tensor gradient = context.Empty(x.shape(), x.dtype());
  const auto meshes = static_cast<std::size_t>(x.shape()[0]);
  const std::size_t size = x.value().elements() / meshes;
  std::vector<double> losses(meshes);
  nn::WithFloatType(x.dtype(), [&]<class T>(T) {
    context.workers().For(meshes, [&](std::size_t i, std::size_t) {
      losses[i] = per_mesh(x.value().template span<T>().subspan(i * size, size), T(1) / T(meshes),
                           gradient.span<T>().subspan(i * size, size));
    });
  });
  double sum = 0;
  for (const double loss : losses) sum += loss;
  return ScalarLoss(name, x, sum / static_cast<double>(meshes), gradient);
}

}  // namespace tilegrad::train
