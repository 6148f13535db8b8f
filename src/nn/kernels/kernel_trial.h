// SPDX-License-Identifier: Apache-2.0
// Random operands for the NN kernels, and rounding bounds of results: for tests that compare
// kernels with their references (tests/nn/kernels, src/proof/selftest).
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "base/rng.h"

namespace tilegrad::nn {

inline std::vector<float> RandomFloats(Rng& rng, std::size_t count) {
  std::vector<float> out(count);
  for (float& v : out) v = static_cast<float>(rng.Uniform(-1, 1));
  return out;
}

inline std::vector<double> AsDoubles(const std::vector<float>& v) { return {v.begin(), v.end()}; }

inline std::vector<double> Magnitudes(const std::vector<float>& v) {
  std::vector<double> out;
  out.reserve(v.size());
  for (float x : v) out.push_back(std::abs(static_cast<double>(x)));
  return out;
}

// gamma_n = n u / (1 - n u), u = 2^-24: a sum of products in any order, with or without fused
// multiply-add, differs from the exact one by at most gamma_n sum |a_i b_i|, n the most roundings
// that one product passes through (Higham, Accuracy and Stability of Numerical Algorithms, 2nd
// edition, sections 3.1 and 4.2): its own, one for each of the additions.
inline double Gamma(std::size_t n) {
  const double nu = static_cast<double>(n) * 0x1.0p-24;
  return nu / (1 - nu);
}

inline double RootMeanSquareError(const std::vector<float>& got, const std::vector<double>& want) {
  double sum = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const double error = static_cast<double>(got[i]) - want[i];
    sum += error * error;
  }
  return std::sqrt(sum / static_cast<double>(got.size()));
}

}  // namespace tilegrad::nn
