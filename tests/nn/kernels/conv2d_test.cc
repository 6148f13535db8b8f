// SPDX-License-Identifier: Apache-2.0
// Direct convolutions and those by matrix products; conv2d_winograd_test.cc has the
// others.
#include "nn/kernels/conv2d/conv2d.h"

#include <gtest/gtest.h>

#include <numeric>

#include "nn/kernels/conv2d_test_util.h"

namespace tilegrad::nn::conv2d_test {

void CheckAgainstReference(const Conv2dShape& s, std::uint64_t seed) {
  SCOPED_TRACE(Describe(s));
  ASSERT_TRUE(s.Check().ok()) << s.Check().message();
  const Conv2dOperands o = RandomConv2dOperands(s, seed);
  const Conv2dResults got = RunConv2d(s, o, {});
  const Conv2dTruth want = RunConv2dReference(s, o, AsDoubles);
  const Conv2dTruth magnitude = RunConv2dReference(s, o, Magnitudes);
  const Conv2dRoundings most(s);
  ExpectWithinRounding(got.y, want.y, magnitude.y, most.y);
  ExpectWithinRounding(got.d_x, want.d_x, magnitude.d_x, most.d_x);
  ExpectWithinRounding(got.d_weight, want.d_weight, magnitude.d_weight, most.d_weight);
}

Conv2dShape RandomShape(Rng& rng) {
  Conv2dShape s;
  s.batch = 1 + rng.Below(3);
  s.in_channels = 1 + rng.Below(9);
  s.out_channels = 1 + rng.Below(20);
  s.kernel_height = 1 + rng.Below(5);
  s.kernel_width = 1 + rng.Below(5);
  s.stride = 1 + rng.Below(3);
  s.padding = rng.Below(4);
  const auto extent = [&](std::size_t kernel) {
    const std::size_t least = kernel > 2 * s.padding ? kernel - 2 * s.padding : 1;
    return least + rng.Below(rng.Below(4) == 0 ? 40 : 14);
  };
  s.in_height = extent(s.kernel_height);
  s.in_width = extent(s.kernel_width);
  return s;
}

TEST(Conv2d, AgreesWithReferenceOnRandomShapes) {
  for (const std::string& target : RunnableTargets()) {
    const OnTarget on(target);
    Rng rng(11);
    for (std::uint64_t i = 0; i < 80; ++i) {
      CheckAgainstReference(RandomShape(rng), i);
      if (HasFatalFailure()) return;
    }
  }
}

// Shapes chosen to cross the blocks of the fast paths: many channels, many images a block, wide
// rows, 1 x 1 kernels with and without a stride that skips pixels, kernels as large as the image.
const std::vector<Conv2dShape> kBlockCrossers = {
    {5, 70, 9, 9, 30, 5, 5, 2, 2},  {2, 300, 4, 4, 40, 3, 3, 1, 1}, {9, 3, 8, 8, 130, 3, 3, 1, 1},
    {1, 2, 5, 150, 3, 3, 3, 1, 1},  {2, 40, 7, 7, 70, 1, 1, 2, 0},  {70, 8, 3, 3, 9, 3, 3, 1, 0},
    {1, 2, 70, 33, 3, 4, 4, 2, 1},  {3, 1, 1, 1, 1, 1, 1, 1, 0},    {2, 3, 5, 6, 4, 2, 3, 4, 5},
    {32, 300, 4, 4, 1, 4, 4, 1, 0}, {3, 40, 5, 7, 30, 1, 1, 1, 0},
};

TEST(Conv2d, AgreesWithReferenceAcrossBlocks) {
  for (const std::string& target : RunnableTargets()) {
    const OnTarget on(target);
    for (const Conv2dShape& s : kBlockCrossers) {
      CheckAgainstReference(s, 5);
      if (HasFatalFailure()) return;
    }
  }
}

TEST(Conv2d, BitsDoNotDependOnWorkers) {
  for (const Conv2dShape& s : kBlockCrossers) {
    SCOPED_TRACE(Describe(s));
    const Conv2dOperands o = RandomConv2dOperands(s, 3);
    const Conv2dResults one = RunConv2d(s, o, {});
    EXPECT_EQ(RunConv2d(s, o, {.workers = 2}), one);
    EXPECT_EQ(RunConv2d(s, o, {.workers = 7}), one);
  }
}

double Dot(const std::vector<float>& a, const std::vector<float>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

// <conv(x, w), d_y> = <x, input_grad(d_y, w)> = <w, weight_grad(x, d_y)>: one trilinear form.
TEST(Conv2d, GradientsAreAdjoints) {
  Rng rng(2);
  for (std::uint64_t i = 0; i < 20; ++i) {
    const Conv2dShape s = RandomShape(rng);
    SCOPED_TRACE(Describe(s));
    const Conv2dOperands o = RandomConv2dOperands(s, i);
    const Conv2dResults r = RunConv2d(s, o, {.workers = 2, .bias = false});
    // Every entry of y carries at most gamma_n of its own terms' magnitude; summed over y that is
    // gamma_n times the trilinear form of absolute values. The other two likewise.
    const std::vector<double> ax = Magnitudes(o.x), aw = Magnitudes(o.weight),
                              ay = Magnitudes(o.d_y);
    double magnitude = 0;
    ForEachConv2dTap(
        s, [&](const Conv2dTap& t) { magnitude += ax[t.x_index] * aw[t.w_index] * ay[t.y_index]; });
    const std::size_t terms = s.kernel_area() * s.in_channels + s.kernel_area() * s.out_channels +
                              2 * s.batch * s.out_pixels() + 8;
    const double bound = 2 * Gamma(terms) * magnitude;
    EXPECT_NEAR(Dot(r.y, o.d_y), Dot(r.d_x, o.x), bound);
    EXPECT_NEAR(Dot(r.y, o.d_y), Dot(r.d_weight, o.weight), bound);
  }
}

TEST(Conv2d, EmptyBatchHasZeroWeightGradient) {
  const Conv2dShape s{0, 2, 4, 4, 3, 3, 3, 1, 1};
  const Conv2dResults r = RunConv2d(s, RandomConv2dOperands(s, 1), {.workers = 2});
  EXPECT_EQ(r.d_weight, std::vector<float>(s.weight_size(), 0.0f));
}

TEST(Conv2d, CheckRefusesShapesThatHaveNoOutput) {
  EXPECT_TRUE((Conv2dShape{1, 1, 3, 3, 1, 5, 5, 1, 1}.Check().ok()));
  EXPECT_FALSE((Conv2dShape{1, 1, 3, 3, 1, 5, 5, 1, 0}.Check().ok()));
  EXPECT_FALSE((Conv2dShape{1, 1, 3, 3, 1, 3, 3, 0, 0}.Check().ok()));
  EXPECT_FALSE((Conv2dShape{1, 0, 3, 3, 1, 3, 3, 1, 0}.Check().ok()));
  const Status status = Conv2dShape{1, 1, 3, 3, 1, 5, 6, 1, 0}.Check();
  EXPECT_NE(status.message().find("5x6"), std::string::npos) << status.message();
}

}  // namespace tilegrad::nn::conv2d_test
