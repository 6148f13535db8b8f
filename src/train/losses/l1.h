// SPDX-License-Identifier: Apache-2.0
// L1 losses of colours (equation 13) and of a network's features (equation 16).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <span>
#include <vector>

#include "nn/networks.h"
#include "nn/tape.h"

namespace tilegrad::train {

// Equation 13 as in the official code: the sum over channels of the mean over pixels and images of
// |I - I'|, which is three times a plain mean for RGB.

// Sum of |a - b| of one image, in double: element i counts in sum i mod kSums, so that none waits
// for the one before.
template <class T>
double AbsoluteDifference(std::span<const T> a, std::span<const T> b) {
  constexpr std::size_t kSums = 8;
  std::array<double, kSums> sums{};
  const std::size_t whole = a.size() / kSums * kSums;
  const auto gap = [&](std::size_t i) {
    return std::abs(static_cast<double>(b[i]) - static_cast<double>(a[i]));
  };
  for (std::size_t i = 0; i < whole; i += kSums) {
    for (std::size_t k = 0; k < kSums; ++k) sums[k] += gap(i + k);
  }
  for (std::size_t i = whole; i < a.size(); ++i) sums[i - whole] += gap(i);
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

// The subgradient `scale` * sign(predicted - truth), 0 where they are equal.
template <class T>
void AbsoluteDifferenceBackward(std::span<const T> truth, std::span<const T> predicted,
                                double scale, std::span<T> d_predicted) {
  const T s = static_cast<T>(scale);
  for (std::size_t i = 0; i < truth.size(); ++i)
    d_predicted[i] = predicted[i] > truth[i] ? s : predicted[i] < truth[i] ? -s : T(0);
}

// image and truth: [N, channels, H, W] of one dtype. A scalar.
nn::Var ColorL1Loss(const nn::Var& image, const nn::Tensor& truth);

// The plain mean over images, channels and pixels of weight * |image - truth|; weight: [N, H, W].
nn::Var WeightedColorL1Loss(const nn::Var& image, const nn::Tensor& truth,
                            const nn::Tensor& weight);

// The Huber loss instead of |d|: d^2 / (2 soft) up to |d| = soft, |d| - soft / 2 beyond. Where an
// unknown makes colours bright or dark, L1 converges to their median, which may be black, and this
// nearly to their mean.
template <class T>
double HuberDifference(std::span<const T> truth, std::span<const T> predicted, double soft) {
  double sum = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double d = std::abs(static_cast<double>(predicted[i]) - static_cast<double>(truth[i]));
    sum += d < soft ? 0.5 * d * d / soft : d - 0.5 * soft;
  }
  return sum;
}

template <class T>
void HuberDifferenceBackward(std::span<const T> truth, std::span<const T> predicted, double soft,
                             double scale, std::span<T> d_predicted) {
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double d = static_cast<double>(predicted[i]) - static_cast<double>(truth[i]);
    d_predicted[i] = static_cast<T>(scale * std::clamp(d / soft, -1.0, 1.0));
  }
}

// soft > 0, in units of colours.
nn::Var ColorHuberLoss(const nn::Var& image, const nn::Tensor& truth, double soft);

// Equation 16: images compared by the features of a network's layers,
//
//   L = mean over images of sum over layers i of |F^i(I) - F^i(I')|_1 / N_i,
//
// N_i the elements of layer i. With a pretrained network it is the perceptual loss, the equation's
// first sum; with the critic in training it is discriminator feature matching, its second sum.

// images [n, 3, h, w], RGB over black in [0, 1] -> the output of each layer, [n, ..]. Perceptual
// networks come from LoadPerceptualNetwork (tasks/classify/perceptual_network.h).
using FeatureFunction = std::function<std::vector<nn::Var>(const nn::Var& images)>;

// `predicted` and `truth` are of one shape. A scalar with a gradient with respect to `predicted`;
// the features of the truth are constants. The network's own weights stay fixed: the optimiser of
// `predicted` does not ask for their gradients.
nn::Var FeatureL1Loss(const FeatureFunction& features, const nn::Var& predicted,
                      const nn::Tensor& truth);

// The levels of a critic without its scores, which the adversarial loss uses. The critic must
// outlive the function.
FeatureFunction FeaturesOf(nn::Critic& critic);

}  // namespace tilegrad::train
