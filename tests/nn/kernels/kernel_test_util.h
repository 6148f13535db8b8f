// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of the NN kernels.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "gtest/gtest.h"
#include "nn/kernels/kernel_trial.h"
#include "support/expect.h"

namespace tilegrad::nn {

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

}  // namespace tilegrad::nn
