// SPDX-License-Identifier: Apache-2.0
// What the tests of the NN kernels share: random operands, and the bound on what rounding may do.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "base/rng.h"
#include "base/simd_target.h"
#include "gtest/gtest.h"

namespace tilegrad::nn {

inline std::vector<float> RandomFloats(Rng& rng, std::size_t count) {
  std::vector<float> out(count);
  for (float& v : out) v = static_cast<float>(rng.Uniform(-1, 1));
  return out;
}

inline std::vector<double> ToDouble(const std::vector<float>& v) { return {v.begin(), v.end()}; }

inline std::vector<double> Magnitudes(const std::vector<float>& v) {
  std::vector<double> out;
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

// |got - want| <= gamma_n magnitude, componentwise; `magnitude` is the same sum over absolute
// values. NaN fails.
inline void ExpectWithinRounding(const std::vector<float>& got, const std::vector<double>& want,
                                 const std::vector<double>& magnitude, std::size_t roundings) {
  ASSERT_EQ(got.size(), want.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    const double error = std::abs(static_cast<double>(got[i]) - want[i]);
    ASSERT_LE(error, Gamma(roundings) * magnitude[i]) << "at " << i << ", expected " << want[i];
  }
}

// Runs its scope's kernels on one SIMD target.
class OnTarget {
 public:
  explicit OnTarget(const std::string& name) : trace_(__FILE__, __LINE__, name) {
    EXPECT_TRUE(ForceTarget(name).ok());
  }
  ~OnTarget() { EXPECT_TRUE(ForceTarget("").ok()); }

 private:
  testing::ScopedTrace trace_;
};

}  // namespace tilegrad::nn
