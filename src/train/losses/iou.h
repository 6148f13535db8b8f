// SPDX-License-Identifier: Apache-2.0
// Equation 12: the silhouette loss, L = mean over images of 1 - |S S'|_1 / |S + S' - S S'|_1.
#pragma once

#include <span>

#include "nn/tape.h"

namespace tilegrad::train {

// Added to the denominator, so that two empty masks give loss 1 and gradient 0.
inline constexpr double kIouEpsilon = 1e-10;

// For one image; sums in double, in order.
template <class T>
struct IouSums {
  double both = 0, either = 0;
  IouSums(std::span<const T> truth, std::span<const T> predicted) {
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const double s = truth[i], a = predicted[i];
      both += s * a;
      either += s + a - s * a;
    }
    either += kIouEpsilon;
  }
  double loss() const { return 1 - both / either; }
};

// dL/dS'_i = -(S_i u - n (1 - S_i)) / u^2 with n = |S S'|, u = |S + S' - S S'|, times `scale`.
template <class T>
void IouBackward(const IouSums<T>& sums, std::span<const T> truth, double scale,
                 std::span<T> d_predicted) {
  const double per_truth = -scale / sums.either,
               rest = scale * sums.both / (sums.either * sums.either);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double s = truth[i];
    d_predicted[i] = static_cast<T>(per_truth * s + rest * (1 - s));
  }
}

// alpha and truth: [N, ...] of one dtype, values in [0, 1]. A scalar.
nn::Var IouLoss(const nn::Var& alpha, const nn::Tensor& truth);

// Mean over images of |S' - S|_2^2 / max(|S|_1, 1). Its minimum is at equality even for values
// between 0 and 1, while equation 12 favours 0 or 1. Arguments as above.
nn::Var SquaredSilhouetteLoss(const nn::Var& alpha, const nn::Tensor& truth);

}  // namespace tilegrad::train
