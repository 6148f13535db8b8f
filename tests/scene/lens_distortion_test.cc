// SPDX-License-Identifier: Apache-2.0
#include "scene/lens_distortion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tilegrad::lens_distortion_test {

TEST(LensDistortion, BendsAsItsFormulaSays) {
  // Every coefficient alone, at a place whose r^2 is 0.25.
  const Vec2Array at = {0.3, 0.4};
  const auto brown = [&](std::size_t which, double x, double y) {
    std::array<double, 8> k = {};
    k[which] = 0.1;
    const Vec2Array bent = Bent(BrownLens(k), at);
    EXPECT_NEAR(bent[0], x, 1e-12) << which;
    EXPECT_NEAR(bent[1], y, 1e-12) << which;
  };
  brown(0, 0.3 * 1.025, 0.4 * 1.025);                             // k1 r^2
  brown(1, 0.3 * 1.00625, 0.4 * 1.00625);                         // k2 r^4
  brown(4, 0.3 * 1.0015625, 0.4 * 1.0015625);                     // k3 r^6
  brown(5, 0.3 / 1.025, 0.4 / 1.025);                             // k4, below the line
  brown(2, 0.3 + 2 * 0.1 * 0.12, 0.4 + 0.1 * (0.25 + 2 * 0.16));  // p1
  brown(3, 0.3 + 0.1 * (0.25 + 2 * 0.09), 0.4 + 2 * 0.1 * 0.12);  // p2
  const double angle = std::atan(0.5);
  const Vec2Array plain = Bent(FisheyeLens({0, 0, 0, 0}), at);
  EXPECT_NEAR(std::hypot(plain[0], plain[1]), angle, 1e-12);
  const Vec2Array bent = Bent(FisheyeLens({0.1, 0, 0, 0.2}), at);
  EXPECT_NEAR(bent[1] / 0.8, angle * (1 + 0.1 * angle * angle + 0.2 * std::pow(angle, 8)), 1e-12);
  EXPECT_TRUE(BrownLens({}).straight());
  EXPECT_FALSE(FisheyeLens({0, 0, 0, 0}).straight());
}

TEST(LensDistortion, IsUndoneWithinTheRadiusWhereItCanBe) {
  const LensDistortion lenses[] = {BrownLens({-0.3, 0.08, 0.01, -0.008, 0.002, 0, 0, 0}),
                                   BrownLens({0.2, 0.1, 0, 0.004, 0, 0.05, 0, 0}),
                                   FisheyeLens({0.05, -0.01, 0.003, -0.001})};
  for (const LensDistortion& lens : lenses) {
    const double largest = LargestRadius(lens);
    EXPECT_GT(largest, 0.9);
    for (double angle = 0.1; angle < 6.3; angle += 0.5) {
      for (const double radius : {0.0, 0.2, 0.5, 0.8}) {
        const Vec2Array at = {radius * std::cos(angle), radius * std::sin(angle)};
        const auto back = Unbent(lens, Bent(lens, at), largest);
        ASSERT_TRUE(back.has_value());
        EXPECT_NEAR((*back)[0], at[0], 1e-7);
        EXPECT_NEAR((*back)[1], at[1], 1e-7);
      }
    }
  }
}

// r (1 - 0.3 r^2) turns back where its derivative, 1 - 0.9 r^2, is 0.
TEST(LensDistortion, EndsWherePolynomialsTurnBack) {
  const LensDistortion lens = BrownLens({-0.3, 0, 0, 0, 0, 0, 0, 0});
  const double largest = LargestRadius(lens);
  EXPECT_NEAR(largest, std::sqrt(1 / 0.9), 0.01);
  EXPECT_FALSE(Unbent(lens, {0.9, 0}, largest).has_value());  // beyond 0.703, what it reaches
  for (const double wild : {1e300, -1e300, 1e-320})
    EXPECT_TRUE(std::isfinite(LargestRadius(BrownLens({wild, wild, wild, 0, 0, 0, 0, 0}))));
}

}  // namespace tilegrad::lens_distortion_test
