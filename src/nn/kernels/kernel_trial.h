// SPDX-License-Identifier: Apache-2.0
// Random operands for the NN kernels, and rounding bounds of results: for tests that compare
// kernels with their references (tests/nn/kernels, src/proof/selftest).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "base/rng.h"
#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/conv2d/conv2d_ref.h"

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
// that one product goes through (Higham, Accuracy and Stability of Numerical Algorithms, 2nd
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

// A convolution with random operands, and all three results of the kernels and of the reference.
// For proofs, as kernel_trial.h.

struct Conv2dOperands {
  std::vector<float> x, weight, bias, d_y;
};

inline Conv2dOperands RandomConv2dOperands(const Conv2dShape& s, std::uint64_t seed) {
  Rng rng(seed);
  return {RandomFloats(rng, s.in_size()), RandomFloats(rng, s.weight_size()),
          RandomFloats(rng, s.out_channels), RandomFloats(rng, s.out_size())};
}

struct Conv2dResults {
  std::vector<float> y, d_x, d_weight;
  bool operator==(const Conv2dResults&) const = default;
};

struct Conv2dRun {
  int workers = 1;
  bool bias = true;
  bool winograd = false;
};

inline Conv2dResults RunConv2d(const Conv2dShape& s, const Conv2dOperands& o,
                               const Conv2dRun& options) {
  const Workers workers(options.workers);
  KernelScratch scratch;
  const KernelContext context{workers, scratch, options.winograd};
  const float poison = std::numeric_limits<float>::quiet_NaN();  // must be overwritten completely
  Conv2dResults r{std::vector<float>(s.out_size(), poison), std::vector<float>(s.in_size(), poison),
                  std::vector<float>(s.weight_size(), poison)};
  Conv2dForward(s, o.x.data(), o.weight.data(), options.bias ? o.bias.data() : nullptr, r.y.data(),
                context);
  Conv2dInputGrad(s, o.d_y.data(), o.weight.data(), r.d_x.data(), context);
  Conv2dWeightGrad(s, o.x.data(), o.d_y.data(), r.d_weight.data(), context);
  return r;
}

struct Conv2dTruth {
  std::vector<double> y, d_x, d_weight;
};

inline Conv2dTruth RunConv2dReference(const Conv2dShape& s, const Conv2dOperands& o,
                                      std::vector<double> (*convert)(const std::vector<float>&)) {
  const std::vector<double> x = convert(o.x), weight = convert(o.weight), bias = convert(o.bias),
                            d_y = convert(o.d_y);
  Conv2dTruth r{std::vector<double>(s.out_size()), std::vector<double>(s.in_size()),
                std::vector<double>(s.weight_size())};
  Conv2dForwardRef(s, x.data(), weight.data(), bias.data(), r.y.data());
  Conv2dInputGradRef(s, d_y.data(), weight.data(), r.d_x.data());
  Conv2dWeightGradRef(s, x.data(), d_y.data(), r.d_weight.data());
  return r;
}

// The most roundings that a product goes through in the direct kernels: those of one sum, plus
// bias, plus the additions of blocks (at most one per channel, or per image row for the weights)
// into the result.
struct Conv2dRoundings {
  explicit Conv2dRoundings(const Conv2dShape& s)
      : y(s.in_channels * (s.kernel_area() + 1) + 2),
        d_x(s.out_channels * (s.kernel_area() + 1) + 2),
        d_weight(s.batch * (s.out_pixels() + s.out_height() + 1) + 2) {}
  std::size_t y, d_x, d_weight;
};

}  // namespace tilegrad::nn
