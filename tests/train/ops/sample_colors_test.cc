// SPDX-License-Identifier: Apache-2.0
// Colours looked up in the picture: values by hand, complex-step derivatives, extremes, bits.
#include "train/ops/sample_colors.h"

#include <gtest/gtest.h>

#include <complex>
#include <limits>

#include "base/rng.h"
#include "nn/nn.h"
#include "train/ops/sample_colors_ref.h"

namespace tilegrad::train {
namespace {

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
// bell lets through from beyond is below e^-25 along the row, and kFarWeight of each of 8 columns of
// four times the cover against the bell's sum of 2.4 of a quarter: 8e-4 / 0.63 of the colour.
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

TEST(SampleColors, ExtremesStayFinite) {
  constexpr float kFar = 1e18f;
  const auto noise = Noise<float>(5);
  const ColorCells<float> nothing{};
  for (const float place : {0.0f, 3.0f, -kFar, kFar}) {
    for (const float narrow : {-kFar, -80.0f, -19.0f, 0.0f, 80.0f, kFar}) {
      for (const ColorCells<float>* cells : {&noise, &nothing}) {
        const float flow[] = {place, -place, narrow, 0.1f}, d_color[] = {1, -1, 1};
        float color[3], d_flow[4];
        const SampledColor<float> sampled(*cells, flow);
        sampled.Forward(color);
        sampled.Backward(d_color, d_flow);
        for (const float x : color) EXPECT_TRUE(std::isfinite(x)) << place << " " << narrow;
        for (const float x : d_flow) EXPECT_TRUE(std::isfinite(x)) << place << " " << narrow;
      }
    }
  }
}

std::vector<float> OpAndGradient(int workers_count) {
  const Workers workers(workers_count);
  nn::Context context(workers, nn::DType::kF32);
  Rng rng(6, 0);
  std::vector<double> pictures(3 * 4 * 32 * 32), flows(3 * 40 * 4);
  for (double& x : pictures) x = rng.Uniform();
  for (double& x : flows) x = 2 * rng.Uniform() - 1;
  const nn::Tensor images = context.From({3, 4, 32, 32}, std::span<const double>(pictures));
  const nn::Var flow =
      nn::Parameter(context, context.From({3, 40, 4}, std::span<const double>(flows)));
  const nn::Var colors = SampleColors(images, flow);
  const nn::Var inputs[] = {flow};
  const auto gradients = nn::Gradients(nn::Sum(nn::Square(colors)), inputs);
  std::vector<float> out;
  for (nn::Tensor tensor : {colors.value(), gradients[0].a().value()})
    for (const float x : tensor.span<float>()) out.push_back(x);
  return out;
}

TEST(SampleColors, BitsDoNotDependOnWorkers) {
  const std::vector<float> one = OpAndGradient(1);
  EXPECT_EQ(one.size(), 3u * 40 * 7);
  EXPECT_EQ(one, OpAndGradient(2));
  EXPECT_EQ(one, OpAndGradient(5));
}

}  // namespace
}  // namespace tilegrad::train
