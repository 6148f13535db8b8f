// SPDX-License-Identifier: Apache-2.0
#include "train/losses/color_l1.h"

#include "train/losses/image_batch.h"

namespace tilegrad::train {

nn::Var ColorL1Loss(const nn::Var& image, const nn::Tensor& truth) {
  const auto& shape = truth.shape();
  const double scale = static_cast<double>(shape[1]) / static_cast<double>(shape.elements());
  return ImageLoss("color loss", image, truth, scale,
                   [scale]<class T>(std::span<const T> s, std::span<const T> p, std::span<T> d) {
                     AbsoluteDifferenceBackward(s, p, scale, d);
                     return AbsoluteDifference(s, p);
                   });
}

nn::Var ColorHuberLoss(const nn::Var& image, const nn::Tensor& truth, double soft) {
  const auto& shape = truth.shape();
  const double scale = static_cast<double>(shape[1]) / static_cast<double>(shape.elements());
  return ImageLoss(
      "color loss", image, truth, scale,
      [scale, soft]<class T>(std::span<const T> s, std::span<const T> p, std::span<T> d) {
        HuberDifferenceBackward(s, p, soft, scale, d);
        return HuberDifference(s, p, soft);
      });
}

}  // namespace tilegrad::train
