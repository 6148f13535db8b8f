// SPDX-License-Identifier: Apache-2.0
// The two image losses over a batch: images in parallel, sums merged in image order.
#include <vector>

#include "base/error.h"
#include "train/losses/color_l1.h"
#include "train/losses/iou.h"
#include "train/losses/scalar_loss.h"

namespace tilegrad::train {
namespace {

// per_image(pair, image, d of that image) -> the loss of that image; the result is their sum times
// `scale`.
template <class PerImage>
nn::Var ImageLoss(const char* name, const nn::Var& predicted, const nn::Tensor& truth, double scale,
                  PerImage per_image) {
  if (!predicted.valid()) return predicted;
  nn::Context& context = predicted.context();
  if (!(predicted.shape() == truth.shape()) || predicted.dtype() != truth.dtype() ||
      truth.shape().rank() < 1) {
    return nn::Fail(predicted,
                    InternalError("{}: predicted {} and truth {} must be equal in shape and dtype",
                                  name, predicted.shape().ToString(), truth.shape().ToString()));
  }
  nn::Tensor gradient = context.Empty(predicted.shape(), predicted.dtype());
  const auto images = static_cast<std::size_t>(truth.shape()[0]);
  std::vector<double> losses(images);
  nn::WithFloatType(predicted.dtype(), [&]<class T>(T) {
    const ImagePair<T> pair{truth.span<T>(), predicted.value().template span<T>(), images};
    context.workers().For(images, [&](std::size_t i, std::size_t) {
      losses[i] = per_image(pair.Truth(i), pair.Predicted(i),
                            gradient.span<T>().subspan(i * pair.pixels(), pair.pixels()));
    });
  });
  double sum = 0;
  for (const double loss : losses) sum += loss;
  return ScalarLoss(name, predicted, scale * sum, gradient);
}

}  // namespace

nn::Var IouLoss(const nn::Var& alpha, const nn::Tensor& truth) {
  const double scale = 1.0 / static_cast<double>(truth.shape()[0]);
  return ImageLoss("iou loss", alpha, truth, scale,
                   [scale]<class T>(std::span<const T> s, std::span<const T> a, std::span<T> d) {
                     const IouSums<T> sums(s, a);
                     IouBackward(sums, s, scale, d);
                     return sums.loss();
                   });
}

nn::Var ColorL1Loss(const nn::Var& image, const nn::Tensor& truth) {
  const auto& shape = truth.shape();
  const double scale = static_cast<double>(shape[1]) / static_cast<double>(shape.elements());
  return ImageLoss("color loss", image, truth, scale,
                   [scale]<class T>(std::span<const T> s, std::span<const T> p, std::span<T> d) {
                     AbsoluteDifferenceBackward(s, p, scale, d);
                     return AbsoluteDifference(s, p);
                   });
}

}  // namespace tilegrad::train
