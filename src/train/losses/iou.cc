// SPDX-License-Identifier: Apache-2.0
#include "train/losses/iou.h"

#include "train/losses/image_batch.h"

namespace tilegrad::train {

nn::Var IouLoss(const nn::Var& alpha, const nn::Tensor& truth) {
  const double scale = 1.0 / static_cast<double>(truth.shape()[0]);
  return ImageLoss("iou loss", alpha, truth, scale,
                   [scale]<class T>(std::span<const T> s, std::span<const T> a, std::span<T> d) {
                     const IouSums<T> sums(s, a);
                     IouBackward(sums, s, scale, d);
                     return sums.loss();
                   });
}

}  // namespace tilegrad::train
