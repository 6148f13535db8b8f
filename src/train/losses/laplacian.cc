// SPDX-License-Identifier: Apache-2.0
#include "train/losses/laplacian.h"

#include "train/losses/mesh_batch.h"

namespace tilegrad::train {

nn::Var LaplacianLoss(const nn::Var& movement, const Topology& topology) {
  return MeshLoss("laplacian loss", movement,
                  [&]<class T>(std::span<const T> m, T scale, std::span<T> d) {
                    std::vector<T> residual(m.size());
                    const double loss = LaplacianForward<T>(topology, m, residual);
                    LaplacianBackward<T>(topology, residual, scale, d);
                    return loss;
                  });
}

}  // namespace tilegrad::train
