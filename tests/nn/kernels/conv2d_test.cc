// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/conv2d.h"

#include <gtest/gtest.h>

#include <numeric>
#include <string>

#include "nn/kernels/conv2d_ref.h"
#include "nn/kernels/kernel_test_util.h"

namespace tilegrad::nn {
namespace {

std::string Describe(const Conv2dShape& s) {
  const auto pair = [](std::size_t a, std::size_t b) {
    return std::to_string(a) + "x" + std::to_string(b);
  };
  return "batch " + std::to_string(s.batch) + ", channels " + pair(s.in_channels, s.out_channels) +
         ", image " + pair(s.in_height, s.in_width) + ", kernel " +
         pair(s.kernel_height, s.kernel_width) + ", stride " + std::to_string(s.stride) +
         ", padding " + std::to_string(s.padding);
}

struct Operands {
  std::vector<float> x, weight, bias, d_y;
};

Operands RandomOperands(const Conv2dShape& s, std::uint64_t seed) {
  Rng rng(seed);
  return {RandomFloats(rng, s.in_size()), RandomFloats(rng, s.weight_size()),
          RandomFloats(rng, s.out_channels), RandomFloats(rng, s.out_size())};
}

struct Results {
  std::vector<float> y, d_x, d_weight;
  bool operator==(const Results&) const = default;
};

Results RunConv2d(const Conv2dShape& s, const Operands& o, int worker_count, bool bias = true) {
  const Workers workers(worker_count);
  KernelScratch scratch;
  const KernelContext context{workers, scratch};
  const float poison = std::numeric_limits<float>::quiet_NaN();  // all of it must be overwritten
  Results r{std::vector<float>(s.out_size(), poison), std::vector<float>(s.in_size(), poison),
            std::vector<float>(s.weight_size(), poison)};
  Conv2dForward(s, o.x.data(), o.weight.data(), bias ? o.bias.data() : nullptr, r.y.data(),
                context);
  Conv2dInputGrad(s, o.d_y.data(), o.weight.data(), r.d_x.data(), context);
  Conv2dWeightGrad(s, o.x.data(), o.d_y.data(), r.d_weight.data(), context);
  return r;
}

struct ReferenceResults {
  std::vector<double> y, d_x, d_weight;
};

ReferenceResults RunReference(const Conv2dShape& s, const Operands& o,
                              std::vector<double> (*convert)(const std::vector<float>&)) {
  const std::vector<double> x = convert(o.x), weight = convert(o.weight), bias = convert(o.bias),
                            d_y = convert(o.d_y);
  ReferenceResults r{std::vector<double>(s.out_size()), std::vector<double>(s.in_size()),
                     std::vector<double>(s.weight_size())};
  Conv2dForwardRef(s, x.data(), weight.data(), bias.data(), r.y.data());
  Conv2dInputGradRef(s, d_y.data(), weight.data(), r.d_x.data());
  Conv2dWeightGradRef(s, x.data(), d_y.data(), r.d_weight.data());
  return r;
}

void CheckAgainstReference(const Conv2dShape& s, std::uint64_t seed) {
  SCOPED_TRACE(Describe(s));
  ASSERT_TRUE(s.Check().ok()) << s.Check().message();
  const Operands o = RandomOperands(s, seed);
  const Results got = RunConv2d(s, o, 1);
  const ReferenceResults want = RunReference(s, o, ToDouble);
  const ReferenceResults magnitude = RunReference(s, o, Magnitudes);
  // Products of one sum, plus bias, plus the additions of blocks (at most one a channel, or one an
  // image row for the weights) into the result.
  const std::size_t taps = s.kernel_area() + 1, pixels = s.out_pixels() + s.out_height() + 1;
  ExpectWithinRounding(got.y, want.y, magnitude.y, s.in_channels * taps + 2);
  ExpectWithinRounding(got.d_x, want.d_x, magnitude.d_x, s.out_channels * taps + 2);
  ExpectWithinRounding(got.d_weight, want.d_weight, magnitude.d_weight, s.batch * pixels + 2);
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
// rows, a 1 x 1 kernel with a stride that skips pixels, a kernel as large as the image.
const std::vector<Conv2dShape> kBlockCrossers = {
    {5, 70, 9, 9, 30, 5, 5, 2, 2}, {2, 300, 4, 4, 40, 3, 3, 1, 1}, {9, 3, 8, 8, 130, 3, 3, 1, 1},
    {1, 2, 5, 150, 3, 3, 3, 1, 1}, {2, 40, 7, 7, 70, 1, 1, 2, 0},  {70, 8, 3, 3, 9, 3, 3, 1, 0},
    {1, 2, 70, 33, 3, 4, 4, 2, 1}, {3, 1, 1, 1, 1, 1, 1, 1, 0},    {2, 3, 5, 6, 4, 2, 3, 4, 5},
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
    const Operands o = RandomOperands(s, 3);
    const Results one = RunConv2d(s, o, 1);
    EXPECT_EQ(RunConv2d(s, o, 2), one);
    EXPECT_EQ(RunConv2d(s, o, 7), one);
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
    const Operands o = RandomOperands(s, i);
    const Results r = RunConv2d(s, o, 2, /*bias=*/false);
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
  const Results r = RunConv2d(s, RandomOperands(s, 1), 2);
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

}  // namespace
}  // namespace tilegrad::nn
