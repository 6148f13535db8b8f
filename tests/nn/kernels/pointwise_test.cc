// SPDX-License-Identifier: Apache-2.0
// Element-by-element kernels against the reference, on every target, over lengths and broadcasts.
#include "nn/kernels/pointwise.h"

#include "nn/kernels/kernel_test_util.h"
#include "nn/kernels/pointwise_ref.h"

namespace tilegrad::nn::pointwise_test {

constexpr double kUlp = 0x1.0p-23;

struct UnaryCase {
  UnaryOp op;
  double ulps;  // 0: one rounding or none, so the same bits as the reference
  double low = -3, high = 3;
};

// The figures of exp (1), log (4), expm1 (4) and tanh (4) are those Highway states; sigmoid adds a
// sum and a quotient to exp; softplus is log1p (2) of exp and a sum; pow is computed in double.
const UnaryCase kUnary[] = {
    {UnaryOp::kNeg, 0},     {UnaryOp::kScale, 0},        {UnaryOp::kAddScalar, 0},
    {UnaryOp::kExp, 1},     {UnaryOp::kLog, 4, 1e-3, 9}, {UnaryOp::kSqrt, 0, 0, 9},
    {UnaryOp::kSquare, 0},  {UnaryOp::kAbs, 0},          {UnaryOp::kSign, 0},
    {UnaryOp::kRelu, 0},    {UnaryOp::kLeakyRelu, 0},    {UnaryOp::kTanh, 4},
    {UnaryOp::kSigmoid, 2}, {UnaryOp::kClamp, 0},        {UnaryOp::kInRange, 0},
    {UnaryOp::kExpm1, 4},   {UnaryOp::kSoftplus, 4},     {UnaryOp::kPow, 1, 1e-3, 9}};

void CheckUnary(const UnaryCase& c, std::size_t n, Rng& rng, const Workers& workers) {
  std::vector<float> x(n), y(n, -77.0f);
  for (float& v : x) v = static_cast<float>(rng.Uniform(c.low, c.high));
  Unary(UnaryProblem<float>{c.op, x.data(), y.data(), n, -0.5, 1.25}, workers);
  for (std::size_t i = 0; i < n; ++i) {
    const double want = c.ulps == 0 ? static_cast<double>(UnaryRef(c.op, x[i], -0.5, 1.25))
                                    : UnaryRef(c.op, static_cast<double>(x[i]), -0.5, 1.25);
    ASSERT_NEAR(static_cast<double>(y[i]), want, c.ulps * kUlp * std::abs(want))
        << "op " << static_cast<int>(c.op) << " x " << x[i];
  }
}

TEST(Pointwise, UnaryEqualsReference) {
  const Workers workers(2);
  for (const auto& target : RunnableTargets()) {
    const OnTarget on(target);
    Rng rng(5);
    for (const UnaryCase& c : kUnary) {
      for (std::size_t n : {0, 1, 3, 4, 7, 8, 9, 33, 40000}) CheckUnary(c, n, rng, workers);
    }
  }
}

float Apply(UnaryOp op, float x) {
  const Workers workers(1);
  Unary(UnaryProblem<float>{op, &x, &x, 1, 0.25, 0.5}, workers);
  return x;
}

TEST(Pointwise, LimitsAndNaN) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  for (const auto& target : RunnableTargets()) {
    const OnTarget on(target);
    for (const UnaryCase& c : kUnary) {
      if (c.op == UnaryOp::kInRange) continue;  // of a mask: no
      EXPECT_TRUE(std::isnan(Apply(c.op, nan))) << static_cast<int>(c.op);
    }
    EXPECT_EQ(Apply(UnaryOp::kInRange, nan), 0.0f);
    EXPECT_EQ(Apply(UnaryOp::kExp, 89.0f), inf);
    EXPECT_EQ(Apply(UnaryOp::kExp, inf), inf);
    EXPECT_EQ(Apply(UnaryOp::kExp, -inf), 0.0f);
    EXPECT_EQ(Apply(UnaryOp::kExpm1, 89.0f), inf);
    EXPECT_EQ(Apply(UnaryOp::kExpm1, -inf), -1.0f);
    EXPECT_EQ(Apply(UnaryOp::kSoftplus, inf), inf);
    EXPECT_EQ(Apply(UnaryOp::kSoftplus, -inf), 0.0f);
    EXPECT_EQ(Apply(UnaryOp::kLog, 0.0f), -inf);
    EXPECT_EQ(Apply(UnaryOp::kLog, inf), inf);
    EXPECT_TRUE(std::isnan(Apply(UnaryOp::kLog, -1.0f)));
    EXPECT_EQ(Apply(UnaryOp::kTanh, 1e30f), 1.0f);
    EXPECT_EQ(Apply(UnaryOp::kTanh, -inf), -1.0f);
    EXPECT_EQ(Apply(UnaryOp::kSigmoid, -200.0f), 0.0f);
    EXPECT_EQ(Apply(UnaryOp::kSigmoid, 200.0f), 1.0f);
    EXPECT_EQ(Apply(UnaryOp::kRelu, -inf), 0.0f);
  }
}

// Signs, zeros, infinities, overflow and underflow of x^p as the C library has them.
TEST(Pointwise, PowerEqualsTheLibraryAtTheLimits) {
  const Workers workers(1);
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  const std::vector<float> x = {0,     -0.0f,  1,      -1,     2,   -2,  -0.5f,
                                1e30f, -1e30f, 1e-30f, 1e-42f, inf, -inf};
  for (const auto& target : RunnableTargets()) {
    const OnTarget on(target);
    for (const double p : {2.0, 3.0, -1.0, -2.0, 0.5, -1.5, 0.0}) {
      std::vector<float> y(x.size());
      Unary(UnaryProblem<float>{UnaryOp::kPow, x.data(), y.data(), x.size(), p, 0}, workers);
      for (std::size_t i = 0; i < x.size(); ++i) {
        const float want = UnaryRef(UnaryOp::kPow, x[i], p, 0);
        // The library gives sqrt(-0) = -0 by its own rule and (-inf)^0.5 = inf; ours stay in the
        // reals.
        if (p != std::floor(p) && std::signbit(x[i])) {
          EXPECT_TRUE(std::isnan(y[i]) || x[i] == 0) << x[i] << "^" << p;
        } else if (std::isfinite(want)) {
          EXPECT_NEAR(y[i], want, kUlp * std::abs(want) + 1e-45) << x[i] << "^" << p;
        } else {
          EXPECT_EQ(y[i], want) << x[i] << "^" << p;
        }
      }
    }
    EXPECT_TRUE(std::isnan(Apply(UnaryOp::kPow, nan)));
  }
}

const BinaryOp kBinary[] = {BinaryOp::kAdd,          BinaryOp::kSub,          BinaryOp::kMul,
                            BinaryOp::kDiv,          BinaryOp::kMax,          BinaryOp::kMin,
                            BinaryOp::kGreater,      BinaryOp::kGreaterEqual, BinaryOp::kReluGrad,
                            BinaryOp::kLeakyReluGrad};

struct Box {
  std::array<std::size_t, 5> extents, strides_a, strides_b;
};

// Every operation rounds once: the same bits as the reference.
TEST(Pointwise, BinaryEqualsReference) {
  const Box boxes[] = {{{1, 1, 1, 1, 37}, {0, 0, 0, 0, 1}, {0, 0, 0, 0, 1}},
                       {{1, 1, 1, 1, 40001}, {0, 0, 0, 0, 1}, {0, 0, 0, 0, 0}},
                       {{1, 1, 3, 5, 9}, {0, 0, 45, 9, 1}, {0, 0, 0, 1, 0}},
                       {{2, 3, 2, 2, 17}, {0, 34, 17, 0, 1}, {12, 4, 2, 1, 0}},
                       {{2, 1, 4, 1, 3}, {4, 0, 1, 0, 0}, {0, 0, 0, 0, 1}}};
  const Workers workers(2);
  Rng rng(6);
  for (const Box& box : boxes) {
    std::size_t n = 1;
    for (std::size_t e : box.extents) n *= e;
    std::vector<float> a = RandomFloats(rng, n), b = RandomFloats(rng, n), want(n), got(n);
    std::copy_n(a.begin(), n / 2, b.begin());  // equal ones, for the comparisons
    for (const BinaryOp op : kBinary) {
      BinaryProblem<float> problem{op,       box.extents, box.strides_a, box.strides_b,
                                   a.data(), b.data(),    want.data(),   0.2};
      BinaryRangeRef(problem, {0, n / box.extents[4], 0, box.extents[4]});
      problem.y = got.data();
      for (const auto& target : RunnableTargets()) {
        const OnTarget on(target);
        Binary(problem, workers);
        ASSERT_EQ(got, want) << static_cast<int>(op);
      }
    }
  }
}

TEST(Pointwise, MaximumKeepsNaN) {
  const Workers workers(1);
  const float nan = std::nanf(""), one = 1.0f;
  for (const auto& target : RunnableTargets()) {
    const OnTarget on(target);
    for (const BinaryOp op : {BinaryOp::kMax, BinaryOp::kMin}) {
      BinaryProblem<float> problem;
      float y = 0;
      problem.op = op, problem.y = &y;
      problem.a = &nan, problem.b = &one;
      Binary(problem, workers);
      EXPECT_TRUE(std::isnan(y));
      problem.a = &one, problem.b = &nan;
      Binary(problem, workers);
      EXPECT_TRUE(std::isnan(y));
    }
  }
}

}  // namespace tilegrad::nn::pointwise_test
