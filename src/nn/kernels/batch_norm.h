// SPDX-License-Identifier: Apache-2.0
// Batch normalisation with the statistics of the batch, and ReLU in the same pass. Ioffe, Szegedy:
// Batch normalization, ICML 2015. Bits depend on shape and SIMD target, never on the number of
// workers.
#pragma once

#include <cstddef>

#include "base/parallel.h"

namespace tilegrad::nn {

struct BatchNormShape {
  std::size_t batch = 1, channels = 1, pixels = 1;      // x and y: [batch, channels, pixels]
  std::size_t count() const { return batch * pixels; }  // elements per channel
  std::size_t size() const { return batch * channels * pixels; }
};

template <class T>
struct BatchNormParameters {
  const T* gamma = nullptr;  // [channels]
  const T* beta = nullptr;   // [channels]
  double epsilon = 1e-5;
  bool relu = false;
};

// mean[c], variance[c] (divided by count()) of x; y = gamma (x - mean) / sqrt(variance + epsilon) +
// beta, clamped to >= 0 if relu.
template <class T>
struct BatchNormForwardProblem {
  BatchNormShape shape;
  BatchNormParameters<T> parameters;
  const T* x = nullptr;
  T* y = nullptr;
  T* mean = nullptr;      // [channels]
  T* variance = nullptr;  // [channels]
};
void BatchNormForward(const BatchNormForwardProblem<float>& problem, const Workers& workers);
void BatchNormForward(const BatchNormForwardProblem<double>& problem, const Workers& workers);

// With h = (x - mean) / sqrt(variance + epsilon), and d_y set to 0 where relu clamped:
//   d_gamma = sum d_y h,  d_beta = sum d_y,
//   d_x = gamma / sqrt(variance + epsilon) (d_y - d_beta / count - h d_gamma / count).
template <class T>
struct BatchNormBackwardProblem {
  BatchNormShape shape;
  BatchNormParameters<T> parameters;
  const T* x = nullptr;
  const T* mean = nullptr;
  const T* variance = nullptr;
  const T* d_y = nullptr;
  T* d_x = nullptr;  // may be d_y
  T* d_gamma = nullptr;
  T* d_beta = nullptr;
};
void BatchNormBackward(const BatchNormBackwardProblem<float>& problem, const Workers& workers);
void BatchNormBackward(const BatchNormBackwardProblem<double>& problem, const Workers& workers);

}  // namespace tilegrad::nn
