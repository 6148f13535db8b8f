// SPDX-License-Identifier: Apache-2.0
// The two mesh regularisers over a batch: meshes in parallel, sums merged in order.
#include <vector>

#include "train/losses/laplacian.h"
#include "train/losses/scalar_loss.h"
#include "train/losses/smoothness.h"

namespace tilegrad::train {
namespace {

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

}  // namespace

nn::Var LaplacianLoss(const nn::Var& movement, const Topology& topology) {
  return MeshLoss("laplacian loss", movement,
                  [&]<class T>(std::span<const T> m, T scale, std::span<T> d) {
                    std::vector<T> residual(m.size());
                    const double loss = LaplacianForward<T>(topology, m, residual);
                    LaplacianBackward<T>(topology, residual, scale, d);
                    return loss;
                  });
}

nn::Var SmoothnessLoss(const nn::Var& positions, std::span<const Face> faces,
                       const Topology& topology) {
  return MeshLoss("smoothness loss", positions,
                  [&]<class T>(std::span<const T> p, T scale, std::span<T> d) {
                    std::vector<FaceNormal<T>> normals;
                    const double loss = SmoothnessForward<T>(topology, faces, p, normals);
                    SmoothnessBackward<T>(topology, faces, p, normals, scale, d);
                    return loss;
                  });
}

}  // namespace tilegrad::train
