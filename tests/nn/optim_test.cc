// SPDX-License-Identifier: Apache-2.0
// Optimisers, schedules and moving averages: steps by hand, and the same bits after saving and
// restoring and for any number of workers.
#include "nn/optim.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "nn/nn.h"

namespace tilegrad::nn {
namespace {

class Optimisers : public ::testing::Test {
 protected:
  Var Matrix(double value) { return Parameter(context_, context_.Full({1, 1}, value)); }
  std::vector<Var> Gradient(const Shape& shape, double value) {
    return {Constant(context_, context_.Full(shape, value))};
  }
  Workers workers_{2};
  Context context_{workers_, DType::kF64};
};

// p = 1, g = 0.5, then 0.5 again: v = 0.5, p = 0.95; v = 0.45 + 0.5, p = 0.95 - 0.095.
TEST_F(Optimisers, SgdWithMomentum) {
  const Var p = Matrix(1.0);
  Sgd sgd(context_, {{"p", p}}, {.learning_rate = 0.1, .momentum = 0.9});
  ASSERT_TRUE(sgd.Step(Gradient({1, 1}, 0.25), 2.0).ok());
  EXPECT_DOUBLE_EQ(p.item(), 0.95);
  ASSERT_TRUE(sgd.Step(Gradient({1, 1}, 0.5)).ok());
  EXPECT_DOUBLE_EQ(p.item(), 0.855);
}

// g = 0.5 + 0.01 * 1 = 0.51, v = 0.51, p = 1 - 0.1 (0.51 + 0.9 * 0.51).
TEST_F(Optimisers, SgdAheadAndWithDecay) {
  const Var p = Matrix(1.0);
  Sgd sgd(context_, {{"p", p}},
          {.learning_rate = 0.1, .momentum = 0.9, .nesterov = true, .weight_decay = 0.01});
  ASSERT_TRUE(sgd.Step(Gradient({1, 1}, 0.5)).ok());
  EXPECT_DOUBLE_EQ(p.item(), 1 - 0.1 * 1.9 * 0.51);
}

// The first step of Adam is the learning rate; the decay takes 0.1 * 0.2 of a matrix first, and
// nothing of a vector.
TEST_F(Optimisers, AdamWDecaysMatrices) {
  const Var matrix = Matrix(1.0), vector = Parameter(context_, context_.Full({1}, 1.0));
  Adam adam(context_, {{"m", matrix}, {"v", vector}}, {.learning_rate = 0.1, .weight_decay = 0.2});
  const std::vector<Var> g = {Gradient({1, 1}, 3.0)[0], Gradient({1}, 3.0)[0]};
  ASSERT_TRUE(adam.Step(g).ok());
  EXPECT_NEAR(matrix.item(), 0.98 - 0.1, 1e-9);
  EXPECT_NEAR(vector.item(), 1.0 - 0.1, 1e-9);
}

TEST(Schedules, FollowTheirFormulas) {
  const CosineSchedule cosine{100, 0.1};
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 0), 2.0);
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 50), 1.1);
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 100), 0.2);
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 1000), 0.2);
  EXPECT_DOUBLE_EQ(StepRate(2, {10, 0.5}, 9), 2.0);
  EXPECT_DOUBLE_EQ(StepRate(2, {10, 0.5}, 20), 0.5);
  EXPECT_DOUBLE_EQ(WarmedUp(2, 4, 0), 0.5);
  EXPECT_DOUBLE_EQ(WarmedUp(2, 4, 3), 2.0);
  EXPECT_DOUBLE_EQ(WarmedUp(2, 4, 9), 2.0);
}

TEST_F(Optimisers, MovingAverageFollows) {
  Var p = Matrix(1.0);
  MovingAverage average(context_, {{"p", p.value()}}, 0.75);
  *p.value().data<double>() = 5.0;
  average.Update();
  EXPECT_DOUBLE_EQ(average.values()[0].value.data<double>()[0], 2.0);
  EXPECT_EQ(average.values()[0].name, "p");
  EXPECT_EQ(average.State()[0].name, "ema.p");
}

// A network of two layers trained with one of the optimisers and averaged.
struct Trained {
  using Make = std::unique_ptr<Optimizer> (*)(Context&, std::vector<NamedVar>);
  Trained(const Workers& workers, Make make) : context(workers) {
    Rng rng(5);
    net.Add<LinearLayer>("fc1", context, LinearShape{.in = 40, .out = 300}, rng);
    net.Add<Activation>("relu", &Relu);
    net.Add<LinearLayer>("fc2", context, LinearShape{.in = 300, .out = 3}, rng);
    optimizer = make(context, Parameters(net));
    average = std::make_unique<MovingAverage>(context, State(net), 0.9);
  }
  void Step(std::uint64_t step) {
    Rng rng(6, step);
    Tensor x = context.Empty({7, 40});
    FillUniform(x, rng, -1, 1);
    const Var loss = Mean(Square(net.Forward(Constant(context, x), Mode::kTrain) - 1.0));
    EXPECT_TRUE(optimizer->Step(Grad(loss, optimizer->parameters())).ok());
    average->Update();
  }
  std::vector<NamedTensor> All() {
    std::vector<NamedTensor> all = State(net);
    for (const auto& more : {optimizer->State(), average->State()}) {
      all.insert(all.end(), more.begin(), more.end());
    }
    return all;
  }
  Bytes Encoded() { return EncodeSafetensors({All(), {}}).value(); }

  Context context;
  Sequential net;
  std::unique_ptr<Optimizer> optimizer;
  std::unique_ptr<MovingAverage> average;
};

const Trained::Make kMakes[] = {
    [](Context& c, std::vector<NamedVar> p) -> std::unique_ptr<Optimizer> {
      return std::make_unique<Adam>(c, std::move(p), AdamOptions{.weight_decay = 0.01});
    },
    [](Context& c, std::vector<NamedVar> p) -> std::unique_ptr<Optimizer> {
      return std::make_unique<Sgd>(c, std::move(p), SgdOptions{.momentum = 0.9, .nesterov = true});
    }};

TEST(SavedAndRestored, SameBitsForAnyNumberOfWorkers) {
  for (const Trained::Make make : kMakes) {
    Bytes want;
    for (const int count : {1, 2, 7}) {
      const Workers workers(count);
      Trained a(workers, make), b(workers, make);
      for (std::uint64_t step = 0; step < 3; ++step) a.Step(step);
      const auto saved = DecodeSafetensors(b.context, a.Encoded()).value().tensors;
      ASSERT_TRUE(LoadState(b.net, saved).ok());
      ASSERT_TRUE(b.optimizer->LoadState(saved).ok());
      ASSERT_TRUE(b.average->LoadState(saved).ok());
      EXPECT_EQ(b.optimizer->steps(), 3);
      for (std::uint64_t step = 3; step < 5; ++step) a.Step(step), b.Step(step);
      EXPECT_EQ(a.Encoded(), b.Encoded());
      if (want.empty()) want = a.Encoded();
      EXPECT_EQ(a.Encoded(), want) << count;
    }
  }
}

}  // namespace
}  // namespace tilegrad::nn
