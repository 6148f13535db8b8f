// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>

#include "nn/kernels/conv2d/winograd.h"
#include "nn/kernels/conv2d_test_util.h"

namespace tilegrad::nn::conv2d_winograd_test {

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

double Largest(const std::vector<float>& v) {
  const auto magnitudes = Magnitudes(v);
  return *std::max_element(magnitudes.begin(), magnitudes.end());
}

// A bound on the terms that one result is a sum of, all of one size: the rows of B^T and of A hold
// at most two ones, those of G sum to at most 2; each along two axes. A forward result adds at most
// 9 slots (its transform has three ones along an axis), an input gradient 9 for each of at most 4
// tiles that overlap, a weight gradient 4.
struct Bound {
  Bound(const Conv2dShape& s, const Conv2dOperands& o)
      : x(4 * Largest(o.x)),
        weight(4 * Largest(o.weight)),
        d_y(4 * Largest(o.d_y)),
        inputs(static_cast<double>(s.in_channels * s.stride * s.stride)),
        outputs(static_cast<double>(s.out_channels)),
        tiles(
            static_cast<double>(s.batch * ((s.out_height() + 1) / 2) * ((s.out_width() + 1) / 2))) {
  }
  double y() const { return 9 * x * weight * inputs + 1; }  // and the bias
  double d_x() const { return 4 * 9 * d_y * weight * outputs; }
  double d_weight() const { return 4 * x * d_y * tiles; }
  double x, weight, d_y, inputs, outputs, tiles;
};

void ExpectWithin(const std::vector<float>& got, const std::vector<double>& want, double magnitude,
                  double terms) {
  constexpr std::size_t kTransforms = 24;  // roundings on the way into and out of a product
  ExpectWithinRounding(got, want, std::vector<double>(want.size(), magnitude),
                       static_cast<std::size_t>(terms) + kTransforms);
}

TEST(Conv2dWinograd, AgreesWithReference) {
  for (const Conv2dShape& s : kShapes) {
    SCOPED_TRACE(Describe(s));
    ASSERT_TRUE(WinogradFits(s));
    const Conv2dOperands o = RandomConv2dOperands(s, 7);
    const Conv2dTruth want = RunConv2dReference(s, o, AsDoubles);
    const Bound bound(s, o);
    for (const std::string& target : RunnableTargets()) {
      const OnTarget on(target);
      const Conv2dResults got = RunConv2d(s, o, {.winograd = true});
      ExpectWithin(got.y, want.y, bound.y(), bound.inputs);
      ExpectWithin(got.d_x, want.d_x, bound.d_x(), bound.outputs);
      ExpectWithin(got.d_weight, want.d_weight, bound.d_weight(), bound.tiles);
    }
  }
}

// Both kernels are off by no more than the bound; any number of workers gives the same bits.
void ExpectAgreesWithDirect(const Conv2dShape& s, std::uint64_t seed) {
  SCOPED_TRACE(Describe(s));
  const Conv2dOperands o = RandomConv2dOperands(s, seed);
  const Conv2dResults direct = RunConv2d(s, o, {}), winograd = RunConv2d(s, o, {.winograd = true});
  const Bound bound(s, o);
  ExpectWithin(winograd.y, AsDoubles(direct.y), 2 * bound.y(), bound.inputs);
  ExpectWithin(winograd.d_x, AsDoubles(direct.d_x), 2 * bound.d_x(), bound.outputs);
  ExpectWithin(winograd.d_weight, AsDoubles(direct.d_weight), 2 * bound.d_weight(), bound.tiles);
  for (const int workers : {2, 7}) {
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

// The bound above is far from what happens. Next to the error of the direct kernels, measured on
// these shapes and AVX2: y 0.7 to 1.6, d_x 0.6 to 1.4, d_weight 1.1 to 2.4 times.
TEST(Conv2dWinograd, ErrorIsNearThatOfDirect) {
  for (const Conv2dShape& s : kShapes) {
    SCOPED_TRACE(Describe(s));
    const Conv2dOperands o = RandomConv2dOperands(s, 8);
    const Conv2dTruth want = RunConv2dReference(s, o, AsDoubles);
    const Conv2dResults direct = RunConv2d(s, o, {}), fast = RunConv2d(s, o, {.winograd = true});
    const double y = RootMeanSquareError(fast.y, want.y) / RootMeanSquareError(direct.y, want.y);
    const double d_x =
        RootMeanSquareError(fast.d_x, want.d_x) / RootMeanSquareError(direct.d_x, want.d_x);
    const double d_weight = RootMeanSquareError(fast.d_weight, want.d_weight) /
                            RootMeanSquareError(direct.d_weight, want.d_weight);
    EXPECT_LT(y, 3);
    EXPECT_LT(d_x, 3);
    EXPECT_LT(d_weight, 3);
    EXPECT_NE(fast.y, direct.y);  // it was not the direct kernel
  }
}

TEST(Conv2dWinograd, BitsDoNotDependOnWorkers) {
  for (const Conv2dShape& s : kShapes) {
    SCOPED_TRACE(Describe(s));
    const Conv2dOperands o = RandomConv2dOperands(s, 3);
    const Conv2dResults one = RunConv2d(s, o, {.winograd = true});
    EXPECT_EQ(RunConv2d(s, o, {.workers = 2, .winograd = true}), one);
    EXPECT_EQ(RunConv2d(s, o, {.workers = 7, .winograd = true}), one);
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

}  // namespace tilegrad::nn::conv2d_winograd_test
