// SPDX-License-Identifier: Apache-2.0
#include "train/losses/smoothness.h"

#include "train/losses/mesh_batch.h"

namespace tilegrad::train {

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
