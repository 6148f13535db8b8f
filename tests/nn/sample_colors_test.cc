// SPDX-License-Identifier: Apache-2.0
// Colours looked up in the picture: values by hand, complex-step derivatives, extremes, bits.
#include <gtest/gtest.h>

#include <complex>
#include <vector>

#include "base/rng.h"
#include "nn/kernels/sample_colors_ref.h"
#include "nn/nn.h"
#include "support/expect.h"

namespace tilegrad::nn::sample_colors_test {

using Complex = std::complex<double>;
using Flow = std::array<double, 4>;

// The left half of the picture is red, a quarter of it covered; the right half is blue.
template <class T>
ColorCells<T> TwoHalves() {
  ColorCells<T> cells{};
  for (auto& row : cells) {
    for (std::size_t i = 0; i < kColorCells; ++i) {
      const bool left = i < kColorCells / 2;
      row[4 * i + (left ? 0 : 2)] = T(left ? 0.25 : 1);
      row[4 * i + 3] = T(left ? 0.25 : 1);
    }
  }
  return cells;
}

template <class T>
ColorCells<T> Noise(std::uint64_t seed) {
  Rng rng(seed, 0);
  ColorCells<T> cells;
  for (auto& row : cells) {
    for (T& value : row) value = T(rng.Uniform());
  }
  return cells;
}

std::array<double, 3> ColorAt(const ColorCells<double>& cells, const Flow& flow) {
  std::array<double, 3> color;
  SampledColor<double>(cells, flow.data()).Forward(color.data());
  return color;
}

// At n = 40 the deviation is a cell's side, 1/8. Seven and a half cells left of the border, what a
// bell lets through from beyond is below e^-25 along the row, and kFarWeight of each of 8 columns
// of four times the cover against the bell's sum of 2.4 of a quarter: 8e-4 / 0.63 of the colour.
TEST(SampleColors, SeesWhatIsThere) {
  const ColorCells<double> cells = TwoHalves<double>();
  const auto left = ColorAt(cells, {-0.9375, 0, 40, 0});
  EXPECT_NEAR(left[0], 1, 2.6e-3);
  EXPECT_NEAR(left[2], 0, 2.6e-3);
  EXPECT_NEAR(left[0] + left[2], 1, 1e-9);
  EXPECT_NEAR(ColorAt(cells, {0.9375, 0, 40, -0.5})[2], 0.5, 1e-3);
}

// As wide as it gets, all cells weigh alike: the mean over what is covered, a fifth of it red.
TEST(SampleColors, WideIsTheMean) {
  const auto mean = ColorAt(TwoHalves<double>(), {0.3, -0.4, -50, 0.25});
  EXPECT_NEAR(mean[0], 0.25, 1e-9);
  EXPECT_NEAR(mean[2], 1.0, 1e-9);
}

TEST(SampleColors, GradientsAreThoseOfTheComplexStep) {
  constexpr double kStep = 1e-30;
  const ColorCells<double> cells = Noise<double>(3);
  const ColorCells<Complex> complex_cells = Noise<Complex>(3);
  Rng rng(4, 0);
  for (int trial = 0; trial < 50; ++trial) {
    const Flow flow = {2 * rng.Uniform() - 1, 3 * rng.Uniform() - 1.5, 6 * rng.Uniform() - 1,
                       rng.Uniform() - 0.5};
    const std::array<double, 3> d_color = {rng.Uniform(), -rng.Uniform(), rng.Uniform()};
    Flow d_flow;
    SampledColor<double>(cells, flow.data()).Backward(d_color.data(), d_flow.data());
    for (std::size_t k = 0; k < 4; ++k) {
      std::array<Complex, 4> shifted = {flow[0], flow[1], flow[2], flow[3]};
      shifted[k] += Complex(0, kStep);
      std::array<Complex, 3> color;
      SampledColor<Complex>(complex_cells, shifted.data()).Forward(color.data());
      double want = 0;
      for (std::size_t c = 0; c < 3; ++c) want += d_color[c] * color[c].imag() / kStep;
      EXPECT_NEAR(d_flow[k], want, 1e-12 * (1 + std::abs(want))) << k << " of trial " << trial;
    }
  }
}

struct OpResult {
  std::vector<double> colors, gradient;
};

constexpr std::int64_t kPictures = 3;

// The operation on noise of 32 x 32 pixels, of which the first picture has nothing; the gradient is
// that of the sum of squares.
OpResult RunOp(DType type, const std::vector<double>& flows, int worker_count) {
  const Workers workers(worker_count);
  Context context(workers, type);
  constexpr std::int64_t size = 32, numbers = 4 * size * size;
  Rng rng(6, 0);
  std::vector<double> pictures(kPictures * numbers);
  for (std::size_t i = numbers; i < pictures.size(); ++i) pictures[i] = rng.Uniform();
  const Tensor images = context.From({kPictures, 4, size, size}, std::span<const double>(pictures));
  const auto vertices = static_cast<std::int64_t>(flows.size()) / (4 * kPictures);
  const Var flow =
      Parameter(context, context.From({kPictures, vertices, 4}, std::span<const double>(flows)));
  const Var colors = SampleColors(images, flow);
  const Var inputs[] = {flow};
  const auto gradients = Gradients(Sum(Square(colors)), inputs);
  const auto numbers_of = [&](Tensor tensor) {
    return WithFloatType(type, [&]<class T>(T) {
      const auto values = tensor.span<T>();
      return std::vector<double>(values.begin(), values.end());
    });
  };
  return {numbers_of(colors.value()), numbers_of(gradients[0].a().value())};
}

// 37 vertices: a tail for vectors of any length.
std::vector<double> RandomFlows() {
  Rng rng(8, 0);
  std::vector<double> flows;
  for (std::int64_t v = 0; v < kPictures * 37; ++v) {
    for (const double x : {2.4 * rng.Uniform() - 1.2, 2.4 * rng.Uniform() - 1.2,
                           8 * rng.Uniform() - 2, rng.Uniform() - 0.5})
      flows.push_back(x);
  }
  return flows;
}

// A colour is a ratio of sums of 256 positive terms, each good to a few 2^-24, so it is good to
// 256 * 2^-24 = 1.5e-5. A gradient sums terms of both signs, at most 2 tau |offset| < 64 times as
// large as the colour: 64 * 1.5e-5.
TEST(SampleColors, VectorsHoldToTheReference) {
  const OpResult want = RunOp(DType::kF64, RandomFlows(), 1);
  for (const std::string target : EveryTarget()) {
    const OpResult got = RunOp(DType::kF32, RandomFlows(), 1);
    for (std::size_t i = 0; i < want.colors.size(); ++i)
      EXPECT_NEAR(got.colors[i], want.colors[i], 1.5e-5) << i;
    for (std::size_t i = 0; i < want.gradient.size(); ++i)
      EXPECT_NEAR(got.gradient[i], want.gradient[i], 1e-3) << i;
  }
}

TEST(SampleColors, ExtremesStayFinite) {
  constexpr double kFar = 3e38;
  std::vector<double> flows;
  for (std::int64_t picture = 0; picture < kPictures; ++picture) {
    for (const double place : {0.0, 3.0, 1e5, -kFar, kFar}) {
      for (const double narrow : {-kFar, -80.0, -19.0, 0.0, 80.0, kFar})
        flows.insert(flows.end(), {place, -place, narrow, 0.1});
    }
  }
  for (const std::string target : EveryTarget()) {
    const OpResult got = RunOp(DType::kF32, flows, 1);
    for (const double x : got.colors) EXPECT_TRUE(std::isfinite(x)) << target;
    for (const double x : got.gradient) EXPECT_TRUE(std::isfinite(x)) << target;
  }
  const OpResult reference = RunOp(DType::kF64, flows, 1);
  for (const double x : reference.gradient) EXPECT_TRUE(std::isfinite(x));
}

}  // namespace tilegrad::nn::sample_colors_test
