// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "base/simd_math_test.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "base/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::HWY_NAMESPACE {
void DecayArray(const float* z, std::size_t n, float* exp, float* one_minus) {
  const hn::CappedTag<float, 4> d;
  for (std::size_t i = 0; i < n; i += hn::Lanes(d)) {
    const auto decay = DecayOf(d, hn::LoadU(d, z + i));
    hn::StoreU(decay.exp, d, exp + i);
    hn::StoreU(decay.one_minus, d, one_minus + i);
  }
}
}  // namespace tilegrad::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/simd_target.h"

namespace tilegrad {
HWY_EXPORT(DecayArray);
namespace {

constexpr double kU = 0x1p-24;

// Every 997th float from 0 to infinity.
std::vector<float> Samples() {
  std::vector<float> z;
  for (std::uint32_t bits = 0; bits < 0x7f800000u; bits += 997) {
    z.push_back(std::bit_cast<float>(bits));
  }
  for (const float special : {86.99999f, 87.0f, 0.34657f, std::numeric_limits<float>::infinity()}) {
    z.push_back(special);
  }
  while (z.size() % 4 != 0) z.push_back(0.0f);
  return z;
}

TEST(SimdMath, DecayIsWithinItsBoundOnEveryTarget) {
  const std::vector<float> z = Samples();
  std::vector<float> exp(z.size()), one_minus(z.size());
  for (const std::string& target : RunnableTargets()) {
    ASSERT_TRUE(ForceTarget(target).ok());
    HWY_DYNAMIC_DISPATCH(DecayArray)(z.data(), z.size(), exp.data(), one_minus.data());
    double worst = 0, worst_one_minus = 0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      const auto x = static_cast<double>(z[i]);
      if (x >= 87) {
        ASSERT_EQ(exp[i], 0.0f);
        ASSERT_EQ(one_minus[i], 1.0f);
        continue;
      }
      worst = std::max(worst, std::abs(static_cast<double>(exp[i]) / std::exp(-x) - 1));
      if (z[i] < 1e-30f) {
        ASSERT_LE(std::abs(static_cast<double>(one_minus[i]) - x), 1e-37);
        continue;
      }
      worst_one_minus = std::max(worst_one_minus,
                                 std::abs(static_cast<double>(one_minus[i]) / -std::expm1(-x) - 1));
    }
    EXPECT_LE(worst, 3 * kU) << target;
    EXPECT_LE(worst_one_minus, 4 * kU) << target;
    EXPECT_GT(worst, 0.1 * kU) << "nothing was measured";
  }
  ASSERT_TRUE(ForceTarget("").ok());
}

}  // namespace
}  // namespace tilegrad
#endif
