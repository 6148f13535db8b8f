// SPDX-License-Identifier: Apache-2.0
// Scalar reference of adam.h.
#pragma once

#include <cmath>

#include "nn/kernels/adam.h"

namespace tilegrad::nn {

template <class T>
void AdamStepRef(const AdamProblem<T>& problem, std::size_t begin, std::size_t end) {
  const AdamCoefficients& c = problem.coefficients;
  const auto beta1 = static_cast<T>(c.beta1), rest1 = static_cast<T>(1 - c.beta1);
  const auto beta2 = static_cast<T>(c.beta2), rest2 = static_cast<T>(1 - c.beta2);
  const auto root = static_cast<T>(c.inverse_root), epsilon = static_cast<T>(c.epsilon);
  const auto step = static_cast<T>(c.step), keep = static_cast<T>(c.keep);
  for (std::size_t i = begin; i < end; ++i) {
    const T g = problem.gradient[i];
    const T m = beta1 * problem.m[i] + rest1 * g;
    const T v = beta2 * problem.v[i] + rest2 * (g * g);
    problem.m[i] = m;
    problem.v[i] = v;
    const T p = keep * problem.parameter[i];
    problem.parameter[i] = p - step * m / (std::sqrt(v) * root + epsilon);
  }
}

template <class T>
double SumOfSquaresRef(const T* x, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += static_cast<double>(x[i]) * static_cast<double>(x[i]);
  return sum;
}

}  // namespace tilegrad::nn
