// SPDX-License-Identifier: Apache-2.0
// One pass of stochastic gradient descent, and of a moving average, over a block of parameters.
// Memory bounds them and every compiler vectorises them, so there is one plain loop for all types.
#pragma once

#include <cstddef>

#include "base/parallel.h"

namespace tilegrad::nn {

//   g = gradient_scale g + weight_decay p
//   v = momentum v + g
//   p = p - rate (nesterov ? g + momentum v : v)
struct SgdCoefficients {
  double rate = 0;
  double momentum = 0;
  double gradient_scale = 1;
  double weight_decay = 0;
  bool nesterov = false;
};

template <class T>
struct SgdProblem {
  std::size_t n = 0;
  T* parameter = nullptr;
  const T* gradient = nullptr;
  T* v = nullptr;
  SgdCoefficients coefficients;
};
template <class T>
void SgdStep(const SgdProblem<T>& problem, const Workers& workers);

// y = decay y + (1 - decay) x.
struct BlendShape {
  std::size_t n = 0;
  double decay = 0;
};
template <class T>
void Blend(const BlendShape& shape, const T* x, T* y, const Workers& workers);

}  // namespace tilegrad::nn
