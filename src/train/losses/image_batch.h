// SPDX-License-Identifier: Apache-2.0
// An image loss over a batch: images in parallel, sums merged in image order.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/error.h"
#include "train/losses/scalar_loss.h"

namespace tilegrad::train {

// N images of `pixels` numbers each (all channels together), contiguous.
template <class T>
struct ImagePair {
  std::span<const T> truth, predicted;  // [N * pixels] each
  std::size_t images = 0;

  std::size_t pixels() const { return images == 0 ? 0 : truth.size() / images; }
  std::span<const T> Truth(std::size_t i) const { return truth.subspan(i * pixels(), pixels()); }
  std::span<const T> Predicted(std::size_t i) const {
    return predicted.subspan(i * pixels(), pixels());
  }
};

// per_image(truth, predicted, d_predicted) -> the loss of one image; the result is their sum times
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

}  // namespace tilegrad::train
