// SPDX-License-Identifier: Apache-2.0
// One face at one pixel: known values, and the adjoint against a complex step.
#include "compat/pytorch3d/layered_fragment.h"

#include <gtest/gtest.h>

#include <complex>
#include <vector>

#include "base/rng.h"

namespace tilegrad::compat::pytorch3d::layered_fragment_test {

using Complex = std::complex<double>;

// x to the left: this one is counter-clockwise as seen.
constexpr double kFace[9] = {0.5, -0.5, 1, -0.5, -0.5, 2, 0, 0.5, 4};

TEST(LayeredFragment, KnownValues) {
  const auto flat = FragmentOf(kFace, 0.0, 0.0, {false, false});
  EXPECT_NEAR(flat.bary[0], 0.25, 1e-7);
  EXPECT_NEAR(flat.bary[2], 0.5, 1e-7);
  EXPECT_NEAR(flat.z, 0.25 + 0.5 + 2, 1e-6);
  EXPECT_TRUE(flat.inside);
  // Distance to the edge from (0.5, -0.5) to (0, 0.5): 0.5 * 0.5 / sqrt(1.25).
  EXPECT_NEAR(flat.dist, -0.05, 1e-12);
  const auto deep = FragmentOf(kFace, 0.0, 0.0, {true, false});
  // 1/z is linear on the screen: 0.25 + 0.25 / 2 + 0.5 / 4.
  EXPECT_NEAR(deep.z, 2.0, 1e-6);
  EXPECT_NEAR(deep.bary[0], 0.5, 1e-6);
}

TEST(LayeredFragment, ClippedOutside) {
  const auto at = FragmentOf(kFace, 0.0, 0.75, {false, true});
  EXPECT_FALSE(at.inside);
  EXPECT_NEAR(at.dist, 0.0625, 1e-12);
  EXPECT_EQ(at.bary[0], 0);
  EXPECT_EQ(at.bary[1], 0);
  EXPECT_NEAR(at.bary[2], 1, 1e-12);
  EXPECT_NEAR(at.z, 4, 1e-12);
}

TEST(LayeredFragment, AdjointIsThatOfAComplexStep) {
  Rng rng(3);
  for (int trial = 0; trial < 400; ++trial) {
    const FragmentRule rule{trial % 2 == 0, trial / 2 % 2 == 0};
    double v[9], d_v[9] = {};
    for (int i = 0; i < 9; ++i) v[i] = i % 3 == 2 ? rng.Uniform(0.5, 3) : rng.Uniform(-1, 1);
    const double px = rng.Uniform(-1, 1), py = rng.Uniform(-1, 1);
    const double d_z = rng.Uniform(-1, 1), d_dist = rng.Uniform(-1, 1);
    const std::array<double, 3> d_bary = {rng.Uniform(-1, 1), rng.Uniform(-1, 1), 1};
    FragmentBackward<double>(v, px, py, rule, d_bary, d_z, d_dist, d_v);
    for (int i = 0; i < 9; ++i) {
      constexpr double kStep = 1e-30;
      std::vector<Complex> shifted(v, v + 9);
      shifted[static_cast<std::size_t>(i)] += Complex(0, kStep);
      const auto at = FragmentOf<Complex>(shifted.data(), Complex(px), Complex(py), rule);
      Complex sum = d_z * at.z + d_dist * at.dist;
      for (std::size_t k = 0; k < 3; ++k) sum += d_bary[k] * at.bary[k];
      const double expected = sum.imag() / kStep;
      EXPECT_NEAR(d_v[i], expected, 1e-9 * (1 + std::abs(expected))) << trial << " " << i;
    }
  }
}

}  // namespace tilegrad::compat::pytorch3d::layered_fragment_test
