// SPDX-License-Identifier: Apache-2.0
// One step of Adam over a block of parameters, reading and writing each number once. Kingma, Ba:
// Adam, ICLR 2015, with epsilon added after the bias correction, as PyTorch does.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/parallel.h"

namespace tilegrad::nn {

//   m = beta1 m + (1 - beta1) g
//   v = beta2 v + (1 - beta2) g^2
//   p = keep p - step m / (sqrt(v) inverse_root + epsilon)
struct AdamCoefficients {
  double beta1 = 0.9, beta2 = 0.999;
  double epsilon = 1e-8;
  double step = 0;          // learning rate / (1 - beta1^t)
  double inverse_root = 1;  // 1 / sqrt(1 - beta2^t)
  double keep = 1;          // 1 - learning rate * weight decay
};

template <class T>
struct AdamProblem {
  std::size_t n = 0;
  T* parameter = nullptr;
  const T* gradient = nullptr;
  T* m = nullptr;
  T* v = nullptr;
  AdamCoefficients coefficients;
};

void AdamStep(const AdamProblem<float>& problem, const Workers& workers);
void AdamStep(const AdamProblem<double>& problem, const Workers& workers);

// The sum of squares in double, merged in an order that depends on n only.
double SumOfSquares(const float* x, std::size_t n, const Workers& workers);
double SumOfSquares(const double* x, std::size_t n, const Workers& workers);
// The same sum for each array, in one loop.
std::vector<double> SumsOfSquares(std::span<const std::span<const float>> arrays,
                                  const Workers& workers);
std::vector<double> SumsOfSquares(std::span<const std::span<const double>> arrays,
                                  const Workers& workers);

}  // namespace tilegrad::nn
