// SPDX-License-Identifier: Apache-2.0
// Reductions and batch normalisation against their references, on every target.
#include "nn/kernels/reduce.h"

#include "nn/kernels/adam.h"
#include "nn/kernels/adam_ref.h"
#include "nn/kernels/batch_norm.h"
#include "nn/kernels/batch_norm_ref.h"
#include "nn/kernels/kernel_test_util.h"
#include "nn/kernels/reduce_ref.h"

namespace tilegrad::nn::reduce_test {

const ReduceLayout kLayouts[] = {{{1, 1, 1}, {1, 1, 1}},  {{1, 1, 1}, {1, 1, 100003}},
                                 {{3, 1, 1}, {37, 1, 1}}, {{5, 7, 1}, {2, 3, 1}},
                                 {{2, 3, 19}, {4, 5, 1}}, {{1, 1, 700}, {1, 9, 1}},
                                 {{4, 2, 3}, {2, 3, 41}}, {{6, 1, 1}, {1, 64, 1}},
                                 {{1, 5, 1}, {3, 1, 70}}, {{1, 1, 3}, {2, 0, 1}}};

TEST(Reduce, SumIsWithinRoundingOfTheReference) {
  const Workers workers(2);
  Rng rng(7);
  for (const ReduceLayout& l : kLayouts) {
    const std::vector<float> x = RandomFloats(rng, l.outputs() * l.inputs_each());
    std::vector<double> want(l.outputs()), magnitude(l.outputs());
    ReduceSumRef(l, AsDoubles(x).data(), want.data(), 0, l.outputs());
    ReduceSumRef(l, Magnitudes(x).data(), magnitude.data(), 0, l.outputs());
    for (const std::string target : EveryTarget()) {
      std::vector<float> got(l.outputs(), -77.0f);
      ReduceSum(l, x.data(), got.data(), workers);
      ExpectWithinRounding(got, want, magnitude, l.inputs_each());
    }
  }
}

TEST(Reduce, ExtremumFindsTheFirst) {
  const Workers workers(2);
  const std::vector<float> x = {3, 1, 3, -2, -2, 0, 5, std::nanf(""), 9};
  const ReduceLayout rows{{3, 1, 1}, {1, 1, 3}}, columns{{1, 1, 3}, {3, 1, 1}};
  std::vector<float> y(3);
  std::vector<std::int32_t> first(3);
  ReduceExtremum(rows, x.data(), y.data(), {1, first.data()}, workers);
  EXPECT_EQ(first, (std::vector<std::int32_t>{0, 5, 7}));
  EXPECT_TRUE(std::isnan(y[2]));
  ReduceExtremum(rows, x.data(), y.data(), {-1, first.data()}, workers);
  EXPECT_EQ(first, (std::vector<std::int32_t>{1, 3, 7}));
  ReduceExtremum(columns, x.data(), y.data(), {-1, first.data()}, workers);
  EXPECT_EQ(first, (std::vector<std::int32_t>{3, 7, 5}));
}

struct NormCase {
  BatchNormShape shape;
  bool relu;
};
const NormCase kNorms[] = {{{5, 3, 1}, false}, {{8, 67, 1}, true}, {{3, 4, 9}, false},
                           {{4, 5, 33}, true}, {{2, 3, 64}, true}, {{2, 2, 3}, false}};

// One forward and backward pass in type T.
template <class T>
struct NormRun {
  NormRun(const NormCase& c, const std::vector<float>& x_in, const std::vector<float>& dy_in)
      : x(x_in.begin(), x_in.end()), dy(dy_in.begin(), dy_in.end()) {
    for (std::size_t i = 0; i < c.shape.channels; ++i) {
      gamma.push_back(static_cast<T>(0.5 + 0.25 * static_cast<double>(i % 4)));
      beta.push_back(static_cast<T>(0.25 * (static_cast<double>(i % 5) - 2)));
    }
    y.resize(x.size());
    dx.resize(x.size());
    for (auto* v : {&mean, &variance, &d_gamma, &d_beta}) v->resize(gamma.size());
    const BatchNormParameters<T> parameters{gamma.data(), beta.data(), 1e-5, c.relu};
    const Workers workers(2);
    BatchNormForward(BatchNormForwardProblem<T>{c.shape, parameters, x.data(), y.data(),
                                                mean.data(), variance.data()},
                     workers);
    BatchNormBackward(
        BatchNormBackwardProblem<T>{c.shape, parameters, x.data(), mean.data(), variance.data(),
                                    dy.data(), dx.data(), d_gamma.data(), d_beta.data()},
        workers);
  }
  std::vector<T> x, dy, gamma, beta, y, mean, variance, dx, d_gamma, d_beta;
};

// x and dy in [-1, 1] and deviations of about 0.6, so every intermediate is of scale 1 but the
// sums, which are of scale count. Each result passes through sums of `count` terms and about ten
// more operations; those of scale 1 depend on mean, deviation and the two sums / count.
TEST(BatchNormKernel, EqualsReferenceWithinRounding) {
  Rng rng(8);
  for (const NormCase& c : kNorms) {
    const auto x = RandomFloats(rng, c.shape.size());
    const auto dy = RandomFloats(rng, c.shape.size());
    const NormRun<double> want(c, x, dy);
    const std::size_t n = c.shape.count() + 10;
    const double sums = static_cast<double>(c.shape.count());
    const auto expect_near = [&](const std::vector<float>& got, const std::vector<double>& exact,
                                 double scale) {
      ExpectWithinRounding(got, exact, std::vector<double>(got.size(), scale), n);
    };
    for (const std::string target : EveryTarget()) {
      const NormRun<float> got(c, x, dy);
      expect_near(got.mean, want.mean, 1);
      expect_near(got.variance, want.variance, 2);
      expect_near(got.y, want.y, 8);  // |h| < 4, and as much for the deviation's share
      expect_near(got.d_beta, want.d_beta, sums);
      expect_near(got.d_gamma, want.d_gamma, 8 * sums);
      // gamma / deviation < 4 where there are two elements or more; three terms of up to 4 each.
      expect_near(got.dx, want.dx, 64);
    }
  }
}

TEST(BatchNormKernel, HandValues) {
  // Channel values 1, 2, 3, 6: mean 3, variance (4 + 1 + 0 + 9) / 4 = 3.5.
  const std::vector<double> x = {1, 2, 3, 6};
  const double gamma = 2, beta = 1;
  std::vector<double> y(4);
  double mean = 0, variance = 0;
  BatchNormForward({{2, 1, 2}, {&gamma, &beta, 0.5, true}, x.data(), y.data(), &mean, &variance},
                   Workers(1));
  EXPECT_DOUBLE_EQ(mean, 3);
  EXPECT_DOUBLE_EQ(variance, 3.5);
  // sqrt(3.5 + 0.5) = 2: y = (x - 3) + 1, then relu.
  EXPECT_EQ(y, (std::vector<double>{0, 0, 1, 4}));
}

TEST(Reduce, SumOfSquaresHasTheAccuracyOfDouble) {
  Rng rng(10);
  for (std::size_t n : {0, 1, 5, 13, 200003}) {
    const auto x = RandomFloats(rng, n);
    const double want = SumOfSquaresRef(x.data(), n);
    for (const std::string target : EveryTarget()) {
      const double got = SumOfSquares(x.data(), n, Workers(2));
      EXPECT_NEAR(got, want, static_cast<double>(n) * 0x1.0p-53 * want);
      EXPECT_EQ(got, SumOfSquares(x.data(), n, Workers(7)));
    }
  }
}

TEST(Reduce, SumsOfSquaresOfManyArraysAreThoseOfEach) {
  Rng rng(11);
  std::vector<std::vector<float>> numbers;
  for (const std::size_t n : {5, 0, 200003, 65536, 65537}) numbers.push_back(RandomFloats(rng, n));
  const std::vector<std::span<const float>> arrays(numbers.begin(), numbers.end());
  for (const int workers : {1, 2, 16}) {
    const std::vector<double> sums = SumsOfSquares(arrays, Workers(workers));
    ASSERT_EQ(sums.size(), arrays.size());
    for (std::size_t i = 0; i < sums.size(); ++i)
      EXPECT_EQ(sums[i], SumOfSquares(arrays[i].data(), arrays[i].size(), Workers(1))) << i;
  }
}

}  // namespace tilegrad::nn::reduce_test
