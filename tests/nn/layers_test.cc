// SPDX-License-Identifier: Apache-2.0
// Layers, initialisers and Adam.
#include "nn/layers.h"

#include <gtest/gtest.h>

#include <cmath>

#include "nn/nn.h"

namespace tilegrad::nn::layers_test {

std::vector<double> Values(const Tensor& t) {
  const auto span = t.span<double>();
  return {span.begin(), span.end()};
}

TEST(Layers, NamesAndCounts) {
  const Workers workers(1);
  Context context(workers);
  Rng rng(1);
  Sequential net;
  auto& encoder = net.Add<Sequential>("encoder");
  encoder.Add<Conv2dLayer>("conv1", context, ConvShape{.in = 4, .out = 6, .kernel = 5}, rng);
  encoder.Add<BatchNorm>("bn1", context, 6);
  net.Add<Flatten>("flatten");
  net.Add<LinearLayer>("fc", context, LinearShape{.in = 6, .out = 2, .bias = false}, rng);
  std::vector<std::string> names;
  for (const NamedTensor& t : State(net)) names.push_back(t.name);
  EXPECT_EQ(names, (std::vector<std::string>{"encoder.conv1.weight", "encoder.conv1.bias",
                                             "encoder.bn1.weight", "encoder.bn1.bias",
                                             "encoder.bn1.running_mean", "encoder.bn1.running_var",
                                             "fc.weight"}));
  EXPECT_EQ(Parameters(net).size(), 5u);
  EXPECT_EQ(CountParameters(net), 4 * 6 * 25 + 6 + 12 + 12);
}

TEST(Layers, DefaultInitialisation) {
  const Workers workers(1);
  Context context(workers);
  Rng rng(3);
  const Conv2dLayer conv(context, {.in = 4, .out = 64, .kernel = 5}, rng);
  double largest = 0, squares = 0;
  for (float w : conv.weight.value().span<float>()) {
    largest = std::max(largest, static_cast<double>(std::abs(w)));
    squares += static_cast<double>(w) * static_cast<double>(w);
  }
  // Uniform in +-1/sqrt(100): variance 0.01 / 3. 6400 draws: the mean of squares has a standard
  // deviation of 0.01 / 3 sqrt(0.8 / 6400) = 1.1 %; six of them are allowed.
  EXPECT_LE(largest, 0.1);
  EXPECT_GT(largest, 0.099);
  EXPECT_NEAR(squares / 6400, 0.01 / 3, 0.067 * 0.01 / 3);
}

TEST(Layers, RunningStatistics) {
  const Workers workers(1);
  Context context(workers, DType::kF64);
  BatchNorm norm(context, 1);
  const Var x = Constant(context, context.From({4, 1}, std::vector<double>{1, 2, 3, 6}));
  norm.Forward(x, Mode::kTrain);
  EXPECT_DOUBLE_EQ(Values(norm.running_mean)[0], 0.1 * 3);
  EXPECT_DOUBLE_EQ(Values(norm.running_variance)[0], 0.9 + 0.1 * 14.0 / 3);  // unbiased
  const Var y = norm.Forward(x, Mode::kEval);
  EXPECT_NEAR(Values(y.value())[3], (6 - 0.3) / std::sqrt(0.9 + 1.4 / 3 + 1e-5), 1e-12);
  EXPECT_DOUBLE_EQ(Values(norm.running_mean)[0], 0.1 * 3);  // eval tracks nothing
}

TEST(AdamOptimizer, HandComputedSteps) {
  const Workers workers(1);
  Context context(workers, DType::kF64);
  Var p = Parameter(context, context.Full({1}, 1.0));
  Adam adam(context, {{"p", p}}, {.learning_rate = 0.1});
  const auto gradient = [&](double g) {
    return std::vector<Var>{Constant(context, context.Full({1}, g))};
  };
  // Step 1: m / (1 - beta1) = g, v / (1 - beta2) = g^2: p moves by the learning rate.
  ASSERT_TRUE(adam.Step(gradient(4.0)).ok());
  EXPECT_NEAR(Values(p.value())[0], 1.0 - 0.1 * 4.0 / (4.0 + 1e-8), 1e-15);
  // Step 2 with g = -2: m = 0.9 0.4 - 0.1 2 = 0.16, v = 0.999 0.016 + 0.001 4.
  ASSERT_TRUE(adam.Step(gradient(-2.0)).ok());
  const double m = 0.16 / 0.19, v = (0.999 * 0.016 + 0.004) / (1 - 0.999 * 0.999);
  EXPECT_NEAR(Values(p.value())[0], 0.9 - 0.1 * m / (std::sqrt(v) + 1e-8), 1e-9);
  EXPECT_EQ(adam.steps(), 2);
}

TEST(AdamOptimizer, RefusesWhatDoesNotFit) {
  const Workers workers(1);
  Context context(workers);
  Var p = Parameter(context, context.Full({2}, 1.0));
  Adam adam(context, {{"net.p", p}}, {});
  const std::vector<Var> wrong = {Constant(context, context.Full({3}, 1.0))};
  const Status status = adam.Step(wrong);
  EXPECT_NE(status.message().find("net.p"), std::string::npos);
  EXPECT_FALSE(adam.Step(std::vector<Var>()).ok());
  EXPECT_EQ(p.value().data<float>()[0], 1.0f);
  EXPECT_EQ(adam.steps(), 0);
}

TEST(AdamOptimizer, NormOfAllGradients) {
  const Workers workers(2);
  Context context(workers);
  const std::vector<Var> g = {Constant(context, context.Full({4}, 1.5)),
                              Constant(context, context.Full({1}, 4.0))};
  EXPECT_DOUBLE_EQ(GlobalNorm(context, g), 5.0);
}

TEST(Layers, LoadingChecksBeforeItChanges) {
  const Workers workers(1);
  Context context(workers);
  Rng rng(11);
  Sequential a, b;
  for (Sequential* net : {&a, &b}) {
    net->Add<Conv2dLayer>("conv", context, ConvShape{.in = 4, .out = 9, .kernel = 5}, rng);
    net->Add<LinearLayer>("fc", context, LinearShape{.in = 5, .out = 3}, rng);
  }
  const auto encoded = [&] { return EncodeSafetensors({State(b), {}}).value(); };
  const Bytes before = encoded();
  auto state = State(a);
  state.pop_back();
  EXPECT_NE(LoadState(b, state).message().find("fc.bias"), std::string::npos);
  state = State(a);
  state[0].value = state[1].value;
  EXPECT_NE(LoadState(b, state).message().find("conv.weight"), std::string::npos);
  EXPECT_EQ(encoded(), before);
}

}  // namespace tilegrad::nn::layers_test
