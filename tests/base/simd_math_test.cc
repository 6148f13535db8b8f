// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "base/simd_math_test.cc"
#include <hwy/foreach_target.h>  // must come before highway.h

#include "base/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::HWY_NAMESPACE {
void HalvingArray(const float* z, std::size_t n, float* power, float* one_minus) {
  const hn::CappedTag<float, 4> d;
  for (std::size_t i = 0; i < n; i += hn::Lanes(d)) {
    const auto halving = Exp2Neg(d, hn::LoadU(d, z + i));
    hn::StoreU(halving.power, d, power + i);
    hn::StoreU(halving.one_minus, d, one_minus + i);
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

#include "support/expect.h"

namespace tilegrad {
HWY_EXPORT(HalvingArray);
namespace {

constexpr double kU = 0x1p-24;

// Every 997th float from 0 to infinity.
std::vector<float> Samples() {
  std::vector<float> z;
  for (std::uint32_t bits = 0; bits < 0x7f800000u; bits += 997) {
    z.push_back(std::bit_cast<float>(bits));
  }
  for (const float special :
       {126.25f, 126.5f, 127.0f, 0.5f, std::numeric_limits<float>::infinity()}) {
    z.push_back(special);
  }
  while (z.size() % 4 != 0) z.push_back(0.0f);
  return z;
}

TEST(SimdMath, Exp2NegIsWithinItsBoundOnEveryTarget) {
  const std::vector<float> z = Samples();
  std::vector<float> power(z.size()), one_minus(z.size());
  for (const std::string target : EveryTarget()) {
    HWY_DYNAMIC_DISPATCH(HalvingArray)(z.data(), z.size(), power.data(), one_minus.data());
    double worst = 0, worst_one_minus = 0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      const auto x = static_cast<double>(z[i]);
      if (x > 126.5) {
        ASSERT_EQ(power[i], 0.0f);
        ASSERT_EQ(one_minus[i], 1.0f);
        continue;
      }
      // Beyond 126 the power is denormal, and within one denormal unit.
      if (x > 126) {
        ASSERT_LE(std::abs(static_cast<double>(power[i]) - std::exp2(-x)), 0x1p-148);
        continue;
      }
      worst = std::max(worst, std::abs(static_cast<double>(power[i]) / std::exp2(-x) - 1));
      if (z[i] < 1e-30f) {
        ASSERT_LE(std::abs(static_cast<double>(one_minus[i]) - x * std::log(2.0)), 1e-37);
        continue;
      }
      worst_one_minus = std::max(
          worst_one_minus,
          std::abs(static_cast<double>(one_minus[i]) / -std::expm1(-x * std::log(2.0)) - 1));
    }
    EXPECT_LE(worst, 3 * kU) << target;
    EXPECT_LE(worst_one_minus, 4 * kU) << target;
    EXPECT_GT(worst, 0.1 * kU) << "nothing was measured";
  }
}

}  // namespace
}  // namespace tilegrad
#endif
