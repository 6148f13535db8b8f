// SPDX-License-Identifier: Apache-2.0
// Direct convolutions, those by matrix products, and those of Winograd.
#include "nn/kernels/conv2d/conv2d.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "nn/kernels/conv2d/winograd.h"
#include "nn/kernels/kernel_test_util.h"
#include "nn/kernels/kernel_trial.h"
#include "support/expect.h"

namespace tilegrad::nn::conv2d_test {

std::string Describe(const Conv2dShape& s) {
  const auto pair = [](std::size_t a, std::size_t b) {
    return std::to_string(a) + "x" + std::to_string(b);
  };
  return "batch " + std::to_string(s.batch) + ", channels " + pair(s.in_channels, s.out_channels) +
         ", image " + pair(s.in_height, s.in_width) + ", kernel " +
         pair(s.kernel_height, s.kernel_width) + ", stride " + std::to_string(s.stride) +
         ", padding " + std::to_string(s.padding);
}

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
  for (const std::string target : EveryTarget()) {
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
  for (const std::string target : EveryTarget()) {
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
  ExpectMessage(Conv2dShape{1, 1, 3, 3, 1, 5, 6, 1, 0}.Check(), "5x6");
}

// Every kind of kernel; odd extents and paddings, so that tiles hang over each edge; channels that
// leave tails, and more inputs than are packed at a time, with panels of the fewest outputs; pixels
// that no output sees.
const std::vector<Conv2dShape> kShapes = {
    {3, 17, 8, 8, 19, 4, 4, 2, 1},   {2, 16, 13, 15, 33, 4, 4, 2, 1},
    {2, 32, 16, 16, 40, 4, 4, 2, 0}, {2, 20, 9, 10, 16, 3, 3, 1, 1},
    {1, 16, 40, 44, 16, 3, 3, 1, 0}, {2, 16, 6, 5, 18, 3, 3, 1, 2},
    {2, 20, 12, 9, 16, 5, 5, 2, 2},  {5, 18, 9, 7, 30, 5, 5, 2, 1},
    {3, 16, 1, 2, 17, 3, 3, 1, 2},   {2, 40, 9, 8, 16, 4, 4, 2, 1},
};

// Roundings are a random walk: of n terms, the sums are some n^0.5 u off, relative to themselves. A
// portion left out of 64 would be an eighth; a tile that is wrong shows in its own numbers.
void ExpectClose(const std::vector<float>& got, const std::vector<float>& want) {
  const double size = RootMeanSquareError(want, std::vector<double>(want.size()));
  EXPECT_LT(RootMeanSquareError(got, AsDoubles(want)), 1e-3 * size);
  for (std::size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], want[i], 1e-2 * size) << i;
}

// Any number of workers gives the same bits.
void ExpectAgreesWithDirect(const Conv2dShape& s, std::uint64_t seed) {
  SCOPED_TRACE(Describe(s));
  const Conv2dOperands o = RandomConv2dOperands(s, seed);
  const Conv2dResults direct = RunConv2d(s, o, {}), winograd = RunConv2d(s, o, {.winograd = true});
  ExpectClose(winograd.y, direct.y);
  ExpectClose(winograd.d_x, direct.d_x);
  ExpectClose(winograd.d_weight, direct.d_weight);
  for (const int workers : {2, 7, 16}) {
    EXPECT_EQ(RunConv2d(s, o, {.workers = workers, .winograd = true}), winograd);
  }
}

// More tiles than are transformed at a time, cut within an image.
TEST(Conv2dWinograd, AgreesWithDirectWhereTilesComeInPortions) {
  ExpectAgreesWithDirect({1, 16, 131, 140, 16, 3, 3, 1, 1}, 7);
}

// Enough tiles for portions of one worker's own: several for one and for two workers, while seven
// share one. Where the stride is 2, those of the input gradient are whole images.
TEST(Conv2dWinograd, AgreesWithDirectWhereWorkersHavePortionsOfTheirOwn) {
  ExpectAgreesWithDirect({61, 64, 16, 15, 50, 4, 4, 2, 1}, 9);
  ExpectAgreesWithDirect({61, 40, 14, 15, 64, 3, 3, 1, 1}, 9);
}

// Enough tiles for groups of sums of the weight gradient, with 4 portions each, and with 2; fewer
// rows of tiles than groups.
TEST(Conv2dWinograd, AgreesWithDirectWhereSumsComeInGroups) {
  ExpectAgreesWithDirect({40, 17, 61, 66, 35, 3, 3, 1, 1}, 9);
  ExpectAgreesWithDirect({50, 16, 65, 64, 18, 4, 4, 2, 1}, 9);
  ExpectAgreesWithDirect({1, 16, 5, 20000, 16, 3, 3, 1, 1}, 9);
}

void ExpectErrorNear(const std::vector<float>& got, const std::vector<float>& direct,
                     const std::vector<double>& want) {
  EXPECT_LT(RootMeanSquareError(got, want), 3 * RootMeanSquareError(direct, want));
}

// Next to the error of the direct kernels, measured on these shapes and AVX2: y 0.7 to 1.6, d_x 0.6
// to 1.4, d_weight 1.1 to 2.4 times.
TEST(Conv2dWinograd, ErrorIsNearThatOfDirectOnEveryTargetForAnyNumberOfWorkers) {
  for (const Conv2dShape& s : kShapes) {
    SCOPED_TRACE(Describe(s));
    ASSERT_TRUE(WinogradFits(s));
    const Conv2dOperands o = RandomConv2dOperands(s, 8);
    const Conv2dTruth want = RunConv2dReference(s, o, AsDoubles);
    for (const std::string target : EveryTarget()) {
      const Conv2dResults direct = RunConv2d(s, o, {}), fast = RunConv2d(s, o, {.winograd = true});
      ExpectErrorNear(fast.y, direct.y, want.y);
      ExpectErrorNear(fast.d_x, direct.d_x, want.d_x);
      ExpectErrorNear(fast.d_weight, direct.d_weight, want.d_weight);
      EXPECT_NE(fast.y, direct.y);  // it was not the direct kernel
      for (const int workers : {2, 7, 16}) {
        EXPECT_EQ(RunConv2d(s, o, {.workers = workers, .winograd = true}), fast);
      }
    }
  }
}

TEST(Conv2dWinograd, LeavesWhatItDoesNotFitToTheDirectKernels) {
  EXPECT_FALSE(WinogradFits({2, 3, 16, 16, 16, 3, 3, 1, 1}));   // few channels
  EXPECT_FALSE(WinogradFits({2, 16, 16, 16, 16, 3, 3, 2, 1}));  // one tap in some phases
  EXPECT_FALSE(WinogradFits({2, 16, 16, 16, 16, 1, 1, 1, 0}));
  EXPECT_FALSE(WinogradFits({2, 16, 16, 16, 16, 3, 3, 1, 3}));  // outputs that see padding only
  EXPECT_FALSE(WinogradFits({2, 16, 16, 16, 16, 3, 4, 1, 0}));  // not square
  EXPECT_FALSE(WinogradFits({2, 16, 4, 4, 16, 4, 4, 2, 1}));    // tiles mostly beyond the edge
}

}  // namespace tilegrad::nn::conv2d_test
