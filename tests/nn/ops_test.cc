// SPDX-License-Identifier: Apache-2.0
// First and second derivatives of every operation, in double, over random shapes.
#include <gtest/gtest.h>

#include "nn/gradient_check.h"

namespace tilegrad::nn {
namespace {

class Ops : public ::testing::Test {
 protected:
  Var Random(const Shape& shape, double low = -1.0, double high = 1.0) {
    return RandomParameter(context_, shape, rng_, low, high);
  }
  void Check(const Function& f, const Inputs& inputs) {
    CheckDerivatives(context_, f, inputs, rng_);
  }
  std::int64_t Extent() { return 1 + static_cast<std::int64_t>(rng_.Below(4)); }

  Workers workers_{2};
  Context context_{workers_, DType::kF64};
  Rng rng_{20191001};
};

TEST_F(Ops, SmoothUnary) {
  const Shape shape = {3, 5};
  Check([](const Inputs& x) { return Neg(x[0]); }, {Random(shape)});
  Check([](const Inputs& x) { return Scale(x[0], -1.7); }, {Random(shape)});
  Check([](const Inputs& x) { return AddScalar(x[0], 0.3); }, {Random(shape)});
  Check([](const Inputs& x) { return Exp(x[0]); }, {Random(shape)});
  Check([](const Inputs& x) { return Log(x[0]); }, {Random(shape, 0.5, 2)});
  Check([](const Inputs& x) { return Sqrt(x[0]); }, {Random(shape, 0.5, 2)});
  Check([](const Inputs& x) { return Square(x[0]); }, {Random(shape)});
  Check([](const Inputs& x) { return Tanh(x[0]); }, {Random(shape)});
  Check([](const Inputs& x) { return Sigmoid(x[0]); }, {Random(shape)});
}

// Away from the kinks (0 and the bounds) by more than the step of the differences; squared, so that
// there is a second derivative.
TEST_F(Ops, UnaryWithKinks) {
  for (const double low : {0.1, -1.0}) {
    const auto x = [&] { return Inputs{Random({4, 3}, low, low + 0.9)}; };
    Check([](const Inputs& v) { return Square(Abs(v[0])); }, x());
    Check([](const Inputs& v) { return Square(Relu(v[0])); }, x());
    Check([](const Inputs& v) { return Square(LeakyRelu(v[0], 0.2)); }, x());
    Check([](const Inputs& v) { return Square(Clamp(v[0], -0.05, 2.0)); }, x());
  }
}

TEST_F(Ops, GradientsAtKinks) {
  const Var x = Parameter(context_, context_.From({5}, std::vector<double>{-1, 0, 0.5, 1, 2}));
  const auto gradient = [&](const Var& y) {
    const auto d = Grad(Sum(y), {x});
    const auto span = d[0].value().span<double>();
    return std::vector<double>(span.begin(), span.end());
  };
  EXPECT_EQ(gradient(Abs(x)), (std::vector<double>{-1, 0, 1, 1, 1}));
  EXPECT_EQ(gradient(Relu(x)), (std::vector<double>{0, 0, 1, 1, 1}));
  EXPECT_EQ(gradient(LeakyRelu(x, 0.25)), (std::vector<double>{0.25, 0.25, 1, 1, 1}));
  EXPECT_EQ(gradient(Clamp(x, 0, 1)), (std::vector<double>{0, 1, 1, 1, 0}));
  const Var ones = Constant(context_, context_.Full({5}, 1.0));
  EXPECT_EQ(gradient(Max(x, ones)), (std::vector<double>{0, 0, 0, 1, 1}));
  EXPECT_EQ(gradient(Min(x, ones)), (std::vector<double>{1, 1, 1, 1, 0}));
}

TEST_F(Ops, BinaryWithBroadcasting) {
  const std::vector<std::pair<Shape, Shape>> shapes = {
      {{2, 3}, {2, 3}},          {{2, 3}, {3}},
      {{4, 1}, {1, 5}},          {{}, {3, 2}},
      {{2, 3, 4, 1}, {3, 1, 5}}, {{2, 1, 3, 1, 2}, {1, 4, 1, 3, 2}}};
  for (const auto& [sa, sb] : shapes) {
    SCOPED_TRACE(sa.ToString() + " " + sb.ToString());
    Check([](const Inputs& v) { return Add(v[0], v[1]); }, {Random(sa), Random(sb)});
    Check([](const Inputs& v) { return Sub(v[0], v[1]); }, {Random(sa), Random(sb)});
    Check([](const Inputs& v) { return Mul(v[0], v[1]); }, {Random(sa), Random(sb)});
    Check([](const Inputs& v) { return Div(v[0], v[1]); }, {Random(sa), Random(sb, 0.7, 2)});
    // One operand is larger everywhere, by more than the step.
    Check([](const Inputs& v) { return Square(Max(v[0], v[1])); }, {Random(sa), Random(sb, 2, 3)});
    Check([](const Inputs& v) { return Square(Min(v[0], v[1])); }, {Random(sa), Random(sb, 2, 3)});
  }
}

TEST_F(Ops, Reductions) {
  const Var x = Random({2, 3, 4, 2});
  Check([](const Inputs& v) { return Square(Sum(v[0])); }, {x});
  Check([](const Inputs& v) { return Square(Mean(v[0])); }, {x});
  for (const Keep keep : {Keep::kNo, Keep::kYes}) {
    Check([=](const Inputs& v) { return Square(Sum(v[0], {0}, keep)); }, {x});
    Check([=](const Inputs& v) { return Square(Sum(v[0], {1, 3}, keep)); }, {x});
    Check([=](const Inputs& v) { return Square(Sum(v[0], {0, 2, 3}, keep)); }, {x});
    Check([=](const Inputs& v) { return Square(Mean(v[0], {2}, keep)); }, {x});
    Check([=](const Inputs& v) { return Square(ReduceMax(v[0], {1, 2}, keep)); }, {x});
    Check([=](const Inputs& v) { return Square(ReduceMin(v[0], {3}, keep)); }, {x});
  }
  Check([](const Inputs& v) { return Square(SumTo(v[0], {3, 1, 2})); }, {x});
}

TEST_F(Ops, MaximumGivesItsGradientToTheFirst) {
  const Var x = Parameter(context_, context_.From({2, 3}, std::vector<double>{1, 5, 5, 7, 7, 0}));
  const auto d = Grad(Sum(ReduceMax(x, {1})), {x});
  const auto span = d[0].value().span<double>();
  EXPECT_EQ(std::vector<double>(span.begin(), span.end()), (std::vector<double>{0, 1, 0, 1, 0, 0}));
}

TEST_F(Ops, Shapes) {
  const Var x = Random({2, 3, 4});
  Check([](const Inputs& v) { return Square(Reshape(v[0], {4, -1})); }, {x});
  Check([](const Inputs& v) { return Square(BroadcastTo(v[0], {3, 2, 3, 4})); }, {x});
  Check([](const Inputs& v) { return Square(BroadcastTo(v[0], {2, 3, 4})); }, {Random({3, 1})});
  Check([](const Inputs& v) { return Square(Permute(v[0], {2, 0, 1})); }, {x});
  Check([](const Inputs& v) { return Square(Transpose(v[0])); }, {Random({2, 5})});
  for (int axis = 0; axis < 3; ++axis) {
    Check([=](const Inputs& v) { return Square(Slice(v[0], axis, 1, 2)); }, {x});
    Check([=](const Inputs& v) { return Square(Pad(v[0], axis, 2, 1)); }, {x});
  }
  Check(
      [](const Inputs& v) {
        return Square(Concat({v[0], v[1], v[0]}, 1));
      },
      {x, Random({2, 2, 4})});
  const Tensor indices = context_.Indices(std::vector<std::int32_t>{2, 0, 2, 2, 1});
  Check([=](const Inputs& v) { return Square(Gather(v[0], 1, indices)); }, {x});
  Check([=](const Inputs& v) { return Square(ScatterAdd(v[0], 0, indices, 4)); }, {Random({5, 3})});
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

TEST_F(Ops, Products) {
  for (const bool ta : {false, true}) {
    for (const bool tb : {false, true}) {
      const std::int64_t m = Extent(), n = Extent(), k = Extent();
      const Shape sa = ta ? Shape{k, m} : Shape{m, k}, sb = tb ? Shape{n, k} : Shape{k, n};
      Check(
          [=](const Inputs& v) {
            return Matmul(v[0], v[1], {ta, tb});
          },
          {Random(sa), Random(sb)});
    }
  }
  Check([](const Inputs& v) { return Linear(v[0], v[1], v[2]); },
        {Random({3, 4}), Random({5, 4}), Random({5})});
  Check([](const Inputs& v) { return Linear(v[0], v[1], Var()); },
        {Random({3, 4}), Random({5, 4})});
}

TEST_F(Ops, Convolutions) {
  for (int trial = 0; trial < 8; ++trial) {
    const std::int64_t n = Extent(), in = Extent(), out = Extent();
    const ImageSize kernel{Extent(), Extent()};
    const ConvOptions options{static_cast<int>(1 + rng_.Below(3)), static_cast<int>(rng_.Below(3))};
    const ImageSize size{kernel.height + Extent(), kernel.width + Extent()};
    SCOPED_TRACE(testing::Message() << trial);
    const Var x = Random({n, in, size.height, size.width});
    const Var w = Random({out, in, kernel.height, kernel.width});
    const Var y = Conv2d(x, w, Var(), options);
    Check([=](const Inputs& v) { return Conv2d(v[0], v[1], v[2], options); },
          {x, w, Random({out})});
    Check([=](const Inputs& v) { return Conv2dInputGrad(v[0], v[1], size, options); },
          {Random(y.shape()), w});
    Check([=](const Inputs& v) { return Conv2dWeightGrad(v[0], v[1], kernel, options); },
          {x, Random(y.shape())});
  }
}

TEST_F(Ops, BatchNormalisation) {
  for (const Shape& shape : {Shape{5, 3}, Shape{2, 3, 2, 2}}) {
    for (const bool relu : {false, true}) {
      SCOPED_TRACE(shape.ToString() + (relu ? " relu" : ""));
      const BatchNormOptions options{.epsilon = 1e-2, .relu = relu};
      // beta lifts half of the channels clear of the kink of relu and sinks the others.
      const Var beta = Parameter(context_, context_.From({3}, std::vector<double>{5, -5, 6}));
      Check([=](const Inputs& v) { return BatchNormTrain(v[0], v[1], v[2], options).y; },
            {Random(shape), Random({3}, 0.5, 1), beta});
      const BatchStatistics statistics{context_.Full({3}, 0.1), context_.Full({3}, 0.7)};
      Check([=](const Inputs& v) { return BatchNormEval(v[0], v[1], v[2], statistics, options); },
            {Random(shape), Random({3}, 0.5, 1), beta});
    }
  }
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

// WGAN-GP: d(penalty)/d(weights) through convolution, linear and leaky relu.
TEST_F(Ops, GradientPenalty) {
  const Var x = Random({2, 2, 6, 6});
  const auto penalty = [&](const Inputs& p) {
    Var h = LeakyRelu(Conv2d(x, p[0], p[1], {2, 1}), 0.2);
    h = LeakyRelu(Linear(Reshape(h, {2, -1}), p[2], p[3]), 0.2);
    const Var d_x = Grad(Sum(h), {x}, {.create_graph = true})[0];
    const Var norm = Sqrt(Sum(Square(d_x), {1, 2, 3}));
    return Mean(Square(norm - 1.0));
  };
  const Inputs weights = {Random({3, 2, 4, 4}), Random({3}), Random({1, 27}), Random({1})};
  const auto d = Grad(penalty(weights), weights);
  ASSERT_TRUE(context_.status().ok()) << context_.status().message();
  Inputs direction;
  for (const Var& w : weights) direction.push_back(RandomConstant(context_, w.shape(), rng_));
  const double slope =
      Slope([&](const Inputs& w) { return penalty(w).item(); }, weights, direction);
  EXPECT_NEAR(Dot(d, direction), slope, 1e-6 * std::abs(slope));
  EXPECT_GT(std::abs(slope), 1e-3);
}

}  // namespace
}  // namespace tilegrad::nn
