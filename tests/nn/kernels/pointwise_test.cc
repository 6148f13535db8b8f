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

// The figures of exp (1), log (4) and tanh (4) are those Highway states; sigmoid adds a sum and a
// quotient to exp; softplus is log1p (2) of exp and a sum.
const UnaryCase kUnary[] = {
    {UnaryOp::kNeg, 0},     {UnaryOp::kScale, 0},        {UnaryOp::kAddScalar, 0},
    {UnaryOp::kExp, 1},     {UnaryOp::kLog, 4, 1e-3, 9}, {UnaryOp::kSqrt, 0, 0, 9},
    {UnaryOp::kSquare, 0},  {UnaryOp::kAbs, 0},          {UnaryOp::kSign, 0},
    {UnaryOp::kRelu, 0},    {UnaryOp::kLeakyRelu, 0},    {UnaryOp::kTanh, 4},
    {UnaryOp::kSigmoid, 2}, {UnaryOp::kSoftplus, 4}};

void CheckUnary(const UnaryCase& c, std::size_t n, Rng& rng, const Workers& workers) {
  std::vector<float> x(n), y(n, -77.0f);
  for (float& v : x) v = static_cast<float>(rng.Uniform(c.low, c.high));
  Unary(UnaryProblem<float>{c.op, x.data(), y.data(), n, -0.5}, workers);
  for (std::size_t i = 0; i < n; ++i) {
    const double want = c.ulps == 0 ? static_cast<double>(UnaryRef(c.op, x[i], -0.5))
                                    : UnaryRef(c.op, static_cast<double>(x[i]), -0.5);
    ASSERT_NEAR(static_cast<double>(y[i]), want, c.ulps * kUlp * std::abs(want))
        << "op " << static_cast<int>(c.op) << " x " << x[i];
  }
}

TEST(Pointwise, UnaryEqualsReference) {
  const Workers workers(2);
  for (const std::string target : EveryTarget()) {
    Rng rng(5);
    for (const UnaryCase& c : kUnary) {
      for (std::size_t n : {0, 1, 3, 4, 7, 8, 9, 33, 40000}) CheckUnary(c, n, rng, workers);
    }
  }
}

float Apply(UnaryOp op, float x) {
  const Workers workers(1);
  Unary(UnaryProblem<float>{op, &x, &x, 1, 0.25}, workers);
  return x;
}

TEST(Pointwise, LimitsAndNaN) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  for (const std::string target : EveryTarget()) {
    for (const UnaryCase& c : kUnary) {
      EXPECT_TRUE(std::isnan(Apply(c.op, nan))) << static_cast<int>(c.op);
    }
    EXPECT_EQ(Apply(UnaryOp::kExp, 89.0f), inf);
    EXPECT_EQ(Apply(UnaryOp::kExp, inf), inf);
    EXPECT_EQ(Apply(UnaryOp::kExp, -inf), 0.0f);
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

const BinaryOp kBinary[] = {BinaryOp::kAdd, BinaryOp::kSub,      BinaryOp::kMul,
                            BinaryOp::kDiv, BinaryOp::kReluGrad, BinaryOp::kLeakyReluGrad};

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
    for (const BinaryOp op : kBinary) {
      BinaryProblem<float> problem{op,       box.extents, box.strides_a, box.strides_b,
                                   a.data(), b.data(),    want.data(),   0.2};
      BinaryRangeRef(problem, {0, n / box.extents[4], 0, box.extents[4]});
      problem.y = got.data();
      for (const std::string target : EveryTarget()) {
        Binary(problem, workers);
        ASSERT_EQ(got, want) << static_cast<int>(op);
      }
    }
  }
}

}  // namespace tilegrad::nn::pointwise_test
