// SPDX-License-Identifier: Apache-2.0
// Operations at kinks, ties and edges, and compositions of them.
// ops_test.cc compares the derivatives of each with differences.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "nn/gradient_check.h"
#include "support/expect.h"

namespace tilegrad::nn::ops_test {

class Ops : public ::testing::Test {
 protected:
  Var Random(const Shape& shape) { return RandomParameter(context_, {shape}, rng_); }
  void ExpectRefused(const Var& y, const char* word) {
    EXPECT_FALSE(y.valid()) << word;
    ExpectMessage(context_.TakeStatus(), word);
  }

  Workers workers_{2};
  Context context_{workers_, DType::kF64};
  Rng rng_{20191001};
};

TEST_F(Ops, GradientsAtKinks) {
  const Var x = Parameter(context_, context_.From({5}, std::vector<double>{-1, 0, 0.5, 1, 2}));
  const auto gradient = [&](const Var& y) { return Numbers(Grad(Sum(y), {x})[0]); };
  EXPECT_EQ(gradient(Abs(x)), (std::vector<double>{-1, 0, 1, 1, 1}));
  EXPECT_EQ(gradient(Relu(x)), (std::vector<double>{0, 0, 1, 1, 1}));
  EXPECT_EQ(gradient(LeakyRelu(x, 0.25)), (std::vector<double>{0.25, 0.25, 1, 1, 1}));
  EXPECT_EQ(gradient(Softplus(x))[1], 0.5);
}

TEST_F(Ops, MaximumGivesItsGradientToTheFirst) {
  const Var x = Parameter(context_, context_.From({2, 3}, std::vector<double>{1, 5, 5, 7, 7, 0}));
  EXPECT_EQ(Numbers(Grad(Sum(ReduceMax(x, {1})), {x})[0]), (std::vector<double>{0, 1, 0, 1, 0, 0}));
}

TEST_F(Ops, ShapesMoveTheRightElements) {
  std::vector<double> values(24);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<double>(i);
  const Var x = Constant(context_, context_.From({2, 3, 4}, values));
  const auto at = [](const Var& v, std::size_t i) { return v.value().data<double>()[i]; };
  EXPECT_EQ(at(Permute(x, {2, 0, 1}), 1 * 6 + 1 * 3 + 2), 12 + 8 + 1);  // [1,1,2] <- x[1,2,1]
  EXPECT_EQ(at(Slice(x, 1, 1, 3), 8), 16);                              // [1,0,0] <- x[1,1,0]
  EXPECT_EQ(at(Pad(x, 2, 1, 2), 7 + 1), 4);                             // [0,1,1] <- x[0,1,0]
  EXPECT_EQ(at(Concat({x, x}, 0), 24), 0);
  EXPECT_EQ(at(Gather(x, 0, context_.Indices(std::vector<std::int32_t>{1, 0})), 0), 12);
}

TEST_F(Ops, PaddingRepeatsTheRightElements) {
  const Var x = Constant(context_, context_.From({3}, std::vector<double>{1, 2, 3}));
  const auto padded = [&](PadMode mode) { return Numbers(Pad(x, 0, 2, 1, mode)); };
  EXPECT_EQ(padded(PadMode::kZero), (std::vector<double>{0, 0, 1, 2, 3, 0}));
  EXPECT_EQ(padded(PadMode::kCircular), (std::vector<double>{2, 3, 1, 2, 3, 1}));
  EXPECT_EQ(padded(PadMode::kReplicate), (std::vector<double>{1, 1, 1, 2, 3, 3}));
  EXPECT_FALSE(Pad(x, 0, -1, 0, PadMode::kCircular).valid());
  EXPECT_FALSE(context_.TakeStatus().ok());
}

// The figures of PyTorch's interpolate (align_corners = False) for these.
TEST_F(Ops, ResizedImages) {
  const Var x = Constant(context_, context_.From({1, 1, 1, 4}, std::vector<double>{0, 4, 8, 2}));
  const auto resized = [&](std::int64_t width, ResizeMode mode) {
    return Numbers(Resize(x, {1, width}, mode));
  };
  EXPECT_EQ(resized(6, ResizeMode::kNearest), (std::vector<double>{0, 0, 4, 8, 8, 2}));
  EXPECT_EQ(resized(8, ResizeMode::kBilinear), (std::vector<double>{0, 1, 3, 5, 7, 6.5, 3.5, 2}));
  EXPECT_EQ(resized(2, ResizeMode::kBilinear), (std::vector<double>{2, 5}));
}

TEST_F(Ops, PooledImages) {
  const Var x = Constant(
      context_, context_.From({1, 1, 3, 3}, std::vector<double>{1, 2, 3, 4, -5, 6, 7, 8, 0}));
  EXPECT_EQ(Numbers(MaxPool2d(x, {2, 2})), (std::vector<double>{4}));
  EXPECT_EQ(Numbers(MaxPool2d(x, {3, 2, 1})), (std::vector<double>{4, 6, 8, 8}));
  EXPECT_EQ(Numbers(AvgPool2d(x, {2, 1})), (std::vector<double>{0.5, 1.5, 3.5, 2.25}));
  EXPECT_EQ(Numbers(AvgPool2d(x, {2, 2, 1})), (std::vector<double>{0.25, 1.25, 2.75, 2.25}));
  EXPECT_FALSE(MaxPool2d(x, {4, 2}).valid());
  EXPECT_FALSE(context_.TakeStatus().ok());
}

TEST_F(Ops, MaximaKeepNaNAndGiveTheirGradientToTheFirst) {
  const double nan = std::nan("");
  const Var x = Parameter(
      context_, context_.From({1, 1, 2, 4}, std::vector<double>{5, 1, 2, nan, 5, 5, 3, 4}));
  const Var y = MaxPool2d(x, {2, 2});
  EXPECT_EQ(Numbers(y)[0], 5);
  EXPECT_TRUE(std::isnan(Numbers(y)[1]));
  EXPECT_EQ(Numbers(Grad(Sum(y), {x})[0]), (std::vector<double>{1, 0, 0, 1, 0, 0, 0, 0}));
}

TEST_F(Ops, WhatDoesNotFitIsNamed) {
  const Var x = Random({2, 3, 4, 4}), w = Random({5, 3, 3, 3}), c = Random({4});
  const auto indices = [&](std::vector<std::int32_t> i) { return context_.Indices(i); };
  ExpectRefused(Gather(x, 4, indices({0})), "axis 4");
  ExpectRefused(Gather(x, 1, indices({3})), "index 3 of 3");
  ExpectRefused(ScatterAdd(x, 1, indices({0}), 3), "1 indices");
  ExpectRefused(TakeAlong(x, indices({0})), "[1] for [2, 3, 4, 4]");
  ExpectRefused(PlaceAlong(c, indices({0, 1}), 4), "[2]");
  ExpectRefused(Resize(x, {0, 3}, ResizeMode::kNearest), "to 0 x 3");
  ExpectRefused(AvgPool2d(x, {3, 0}), "stride 0");
  ExpectRefused(Conv2dInputGrad(x, w, {4, 4}, {1, 1, PadMode::kCircular}), "zeros only");
  ExpectRefused(LogSoftmax(x, 7), "axis 7");
  ExpectRefused(CrossEntropy(x, indices({0, 1})), "2 labels");
  const Tensor none, three = context_.Zeros({3});
  ExpectRefused(BatchNormEval(x, Random({3}), Random({3}), {three, none}), "running statistics");
  const Context floats(workers_);
  ExpectRefused(BatchNormEval(x, Random({3}), Random({3}), {three, floats.Zeros({3})}), "F32 [3]");
  const Var whole = Constant(context_, indices({1, 2}));
  ExpectRefused(BroadcastTo(whole, {3, 2}), "I32");
  ExpectRefused(SumTo(whole, {1}), "I32");
}

// An error in one of two contexts would go unnoticed in the other.
TEST_F(Ops, OperandsOfTwoContextsAreRefused) {
  Context other(workers_, DType::kF64);
  const Var x = Random({3}), y = Parameter(other, other.Full({3}, 1)), broken = Gather(y, 9, {});
  EXPECT_FALSE(other.TakeStatus().ok());
  for (const Var& foreign : {y, broken}) {
    EXPECT_FALSE((x + foreign).valid());
    ExpectMessage(context_.TakeStatus(), "add: operands are of two contexts");
    EXPECT_FALSE(other.TakeStatus().ok());
    EXPECT_FALSE(Concat({x, foreign}, 0).valid());
    EXPECT_FALSE(context_.TakeStatus().ok());
    EXPECT_FALSE(other.TakeStatus().ok());
  }
}

// Negative sizes, and those whose product no integer holds, must not reach a kernel.
TEST_F(Ops, ImpossibleSizesAreRefused) {
  constexpr std::int64_t kHuge = std::int64_t{1} << 62;
  constexpr int kLargest = std::numeric_limits<int>::max();
  const Var x = Random({1, 2, 3, 3}), w = Random({2, 2, 3, 3}), row = Random({1, 2});
  ExpectRefused(Conv2dInputGrad(Random({1, 2, 1, 1}), w, {-3, 3}, {1, 3}), "[1, 2, -3, 3]");
  ExpectRefused(Conv2dInputGrad(x, w, {std::numeric_limits<std::int64_t>::max(), 3}, {1, 1}),
                "too large for a tensor");
  ExpectRefused(Conv2dWeightGrad(x, x, {-1, 1}, {}), "[2, 2, -1, 1]");
  ExpectRefused(Conv2d(x, w, Var(), {1, kLargest}), "too large for a tensor");
  ExpectRefused(Reshape(row, {-1, -1, -1}), "[-1, -1, -1]");
  ExpectRefused(Reshape(row, {-1, kHuge, 4}), "reshape");
  ExpectRefused(BroadcastTo(row, {-1, 2}), "[-1, 2]");
  ExpectRefused(BroadcastTo(row, {kHuge, 4, 2}), "too large for a tensor");
  ExpectRefused(Pad(row, 0, kHuge, kHuge), "pad");
  ExpectRefused(Pad(row, 0, 1 << 30, 1 << 30, PadMode::kReplicate), "pad");
  ExpectRefused(Resize(x, {kHuge, 1}, ResizeMode::kNearest), "resize");
  const Tensor nothing = context_.Indices({});
  ExpectRefused(ScatterAdd(Random({0}), 0, nothing, -5), "[-5]");
  ExpectRefused(ScatterAdd(Random({0}), 0, nothing, kHuge), "too large for a tensor");
  const Var tall = Random({1 << 21, 0}), wide = Random({0, 1 << 21});
  ExpectRefused(Matmul(tall, wide), "[2097152, 2097152]");
  ExpectRefused(Linear(tall, tall, Var()), "[2097152, 2097152]");
}

// A stride or a window beyond the image is like one that just leaves it.
TEST_F(Ops, StridesAndWindowsBeyondTheImage) {
  constexpr int kLargest = std::numeric_limits<int>::max();
  const Var x = Random({1, 2, 4, 3}), w = Random({2, 2, 3, 3});
  const auto derivative = [&](int stride) {
    const Var y = Conv2d(x, w, Var(), {stride, 1});
    return Numbers(Grad(Sum(Square(y)), {x})[0]);
  };
  EXPECT_EQ(derivative(kLargest), derivative(6));
  const Var mean = AvgPool2d(x, {kLargest, 1, kLargest / 2});
  EXPECT_NEAR(Numbers(mean)[0] * kLargest * kLargest, Numbers(Sum(x, {2, 3}))[0], 1e-9);
}

TEST_F(Ops, ConvolutionsOverTheEdge) {
  const Var x = Constant(context_, context_.From({1, 1, 1, 4}, std::vector<double>{1, 2, 3, 5}));
  const Var w = Constant(context_, context_.From({1, 1, 1, 3}, std::vector<double>{1, 10, 100}));
  const Var row = PadImage(x, {.left = 1, .right = 1}, PadMode::kCircular);
  EXPECT_EQ(Numbers(Conv2d(row, w, Var(), {})), (std::vector<double>{215, 321, 532, 153}));
  // Each pixel paints a scaled kernel.
  const Var up = Conv2dInputGrad(x, w, {1, 9}, {.stride = 2});
  EXPECT_EQ(Numbers(up), (std::vector<double>{1, 10, 102, 20, 203, 30, 305, 50, 500}));
}

TEST_F(Ops, SoftmaxOfLargeNumbersIsFinite) {
  const Var x = Constant(context_, context_.From({1, 2}, std::vector<double>{1e300, 1e300}));
  EXPECT_EQ(Numbers(Softmax(x, 1)), (std::vector<double>{0.5, 0.5}));
  const Tensor labels = context_.Indices(std::vector<std::int32_t>{1});
  EXPECT_DOUBLE_EQ(CrossEntropy(x, labels).item(), std::log(2.0));
  const Tensor beyond = context_.Indices(std::vector<std::int32_t>{2});
  ExpectRefused(CrossEntropy(x, beyond), "index 2 of 2");
}

// The fused gradient and the one composed of operations are the same formula.
TEST_F(Ops, BatchNormalisationFusedEqualsComposed) {
  const Var x = Random({6, 4, 3, 3}), gamma = Random({4}), beta = Random({4});
  const Var weights = RandomConstant(context_, x.shape(), rng_);
  const auto grad = [&](bool create_graph) {
    const Var y = BatchNormTrain(x, gamma, beta, {.relu = true}).y;
    return Grad(Sum(Mul(weights, y)), {x, gamma, beta}, {.create_graph = create_graph});
  };
  const auto fused = grad(false), composed = grad(true);
  for (std::size_t i = 0; i < fused.size(); ++i) {
    for (std::size_t k = 0; k < fused[i].value().elements(); ++k) {
      // Sums of 54 products of scale 1 in another order: 54 eps, and a little for the quotients.
      EXPECT_NEAR(fused[i].value().data<double>()[k], composed[i].value().data<double>()[k], 1e-13);
    }
  }
}

// First and second derivatives of every operation of cases/: in double against differences, and in
// float on every SIMD target against double.

void Examine(const OpCase& c) {
  SCOPED_TRACE(c.name);
  const Workers workers(2);
  Context exact(workers, DType::kF64);
  Rng rng(20191002);
  const Leaves leaves = RandomLeaves(exact, c, rng);
  ASSERT_TRUE(exact.status().ok()) << exact.status().message();
  const Derivatives want = Differentiate(c.function, leaves);
  ASSERT_TRUE(exact.status().ok()) << exact.status().message();
  ExpectSlopes(c.function, leaves, want);
  std::vector<double> condition;
  for (const Var* q : {&want.s, &want.first, &want.second}) {
    condition.push_back(Condition(*q, leaves));
  }
  for (const std::string target : EveryTarget()) {
    Context context(workers);
    ExpectFloatAgrees(c, want, condition, Differentiate(c.function, InFloat(context, leaves)));
    EXPECT_TRUE(context.status().ok()) << context.status().message();
  }
}

void ExamineAll(void (*add)(CaseList&)) {
  CaseList list(20191001);
  add(list);
  for (const OpCase& c : list.cases) Examine(c);
}

TEST(Derivatives, Pointwise) { ExamineAll(AddPointwiseCases); }
TEST(Derivatives, Reductions) { ExamineAll(AddReduceCases); }
TEST(Derivatives, Shapes) { ExamineAll(AddShapeCases); }
TEST(Derivatives, Products) { ExamineAll(AddProductCases); }
TEST(Derivatives, Images) { ExamineAll(AddImageCases); }
TEST(Derivatives, Softmax) { ExamineAll(AddSoftmaxCases); }
TEST(Derivatives, Normalisation) { ExamineAll(AddNormCases); }

}  // namespace tilegrad::nn::ops_test
