// SPDX-License-Identifier: Apache-2.0
// Adam, schedules and moving averages: steps by hand, and the same bits after saving and
// restoring and for any number of workers.
#include "nn/optim.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <optional>

#include "nn/nn.h"

namespace tilegrad::nn::optim_test {

class Optimisers : public ::testing::Test {
 protected:
  Var Matrix(double value) { return Parameter(context_, context_.Full({1, 1}, value)); }
  std::vector<Var> Gradient(const Shape& shape, double value) {
    return {Constant(context_, context_.Full(shape, value))};
  }
  Workers workers_{2};
  Context context_{workers_, DType::kF64};
};

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

class Halving : public StepMap {
 public:
  void Apply(std::span<float> x) override {
    for (float& number : x) number *= 0.5f;
  }
};

// The first step through a map M is rate M M g / max |M g|; number by number it would be the rate.
TEST(StepMaps, KeepTheDirectionOfTheGradient) {
  const Workers workers(1);
  Context context(workers);
  Halving half;
  const Var p = Parameter(context, context.Zeros({3}));
  Adam adam(context, {{"p", p}}, {.learning_rate = 0.1, .map = &half});
  const std::vector<Var> g = {
      Constant(context, context.From({3}, std::span<const float>({4.0f, -2.0f, 0.0f})))};
  ASSERT_TRUE(adam.Step(g).ok());
  const auto moved = p.value().span<float>();
  EXPECT_NEAR(moved[0], -0.05, 1e-7);
  EXPECT_NEAR(moved[1], 0.025, 1e-7);
  EXPECT_EQ(moved[2], 0);
  EXPECT_EQ(g[0].value().data<float>()[0], 4);  // the caller's gradient stays
  const std::vector<Var> none = {Constant(context, context.Zeros({3}))};
  ASSERT_TRUE(adam.Step(none).ok());
  EXPECT_LT(moved[0], -0.05);  // its average goes on
}

TEST_F(Optimisers, StepMapsAreOfFloats) {
  Halving half;
  const Var p = Matrix(1.0);
  Adam adam(context_, {{"p", p}}, {.map = &half});
  EXPECT_FALSE(adam.Step(Gradient({1, 1}, 3.0)).ok());
  EXPECT_EQ(p.item(), 1);
}

TEST(Schedules, FollowTheirFormulas) {
  const CosineSchedule cosine{100, 0.1};
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 0), 2.0);
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 50), 1.1);
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 100), 0.2);
  EXPECT_DOUBLE_EQ(CosineRate(2, cosine, 1000), 0.2);
  EXPECT_DOUBLE_EQ(WarmedUp(2, 4, 0), 0.5);
  EXPECT_DOUBLE_EQ(WarmedUp(2, 4, 3), 2.0);
  EXPECT_DOUBLE_EQ(WarmedUp(2, 4, 9), 2.0);
}

TEST_F(Optimisers, AveragesAreFoundInACheckpoint) {
  const Var p = Parameter(context_, context_.Full({2}, 1.0));
  const MovingAverage average(context_, {{"net.p", p.value()}}, 0.5);
  std::vector<NamedTensor> state = average.State();
  state.push_back({"net.p", p.value()});
  state.push_back({"adam.m", p.value()});
  const auto averages = Averages(state);
  ASSERT_EQ(averages.size(), 1u);
  EXPECT_EQ(averages[0].name, "net.p");
  EXPECT_TRUE(Averages({{"net.p", p.value()}}).empty());
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

// A network of two layers, trained and averaged.
struct Trained {
  explicit Trained(const Workers& workers) : context(workers) {
    Rng rng(5);
    net.Add<LinearLayer>("fc1", context, LinearShape{.in = 40, .out = 300}, rng);
    net.Add<Activation>("relu", &Relu);
    net.Add<LinearLayer>("fc2", context, LinearShape{.in = 300, .out = 3}, rng);
    adam.emplace(context, Parameters(net), AdamOptions{.weight_decay = 0.01});
    average = std::make_unique<MovingAverage>(context, State(net), 0.9);
  }
  void Step(std::uint64_t step) {
    Rng rng(6, step);
    Tensor x = context.Empty({7, 40});
    FillUniform(x, rng, -1, 1);
    const Var loss = Mean(Square(net.Forward(Constant(context, x), Mode::kTrain) - 1.0));
    EXPECT_TRUE(adam->Step(Grad(loss, adam->parameters())).ok());
    average->Update();
  }
  std::vector<NamedTensor> All() {
    std::vector<NamedTensor> all = State(net);
    for (const auto& more : {adam->State(), average->State()}) {
      all.insert(all.end(), more.begin(), more.end());
    }
    return all;
  }
  Bytes Encoded() { return EncodeSafetensors({All(), {}}).value(); }

  Context context;
  Sequential net;
  std::optional<Adam> adam;
  std::unique_ptr<MovingAverage> average;
};

TEST(SavedAndRestored, SameBitsForAnyNumberOfWorkers) {
  Bytes want;
  for (const int count : {1, 2, 7}) {
    const Workers workers(count);
    Trained a(workers), b(workers);
    for (std::uint64_t step = 0; step < 3; ++step) a.Step(step);
    const auto saved = DecodeSafetensors(b.context, a.Encoded()).value().tensors;
    ASSERT_TRUE(LoadState(b.net, saved).ok());
    ASSERT_TRUE(b.adam->LoadState(saved).ok());
    ASSERT_TRUE(b.average->LoadState(saved).ok());
    EXPECT_EQ(b.adam->steps(), 3);
    for (std::uint64_t step = 3; step < 5; ++step) {
      a.Step(step);
      b.Step(step);
    }
    EXPECT_EQ(a.Encoded(), b.Encoded());
    if (want.empty()) want = a.Encoded();
    EXPECT_EQ(a.Encoded(), want) << count;
  }
}

TEST(SavedAndRestored, RefusesACountOfStepsBelowZero) {
  const Workers workers(1);
  Trained trained(workers);
  trained.Step(0);
  const Bytes before = trained.Encoded();
  auto state = DecodeSafetensors(trained.context, before).value().tensors;
  for (NamedTensor& t : state) {
    if (t.name.ends_with(".steps")) *t.value.data<std::int64_t>() = -1;
    if (t.value.dtype() == DType::kF32) t.value.data<float>()[0] += 1;
  }
  EXPECT_EQ(trained.adam->LoadState(state).code(), StatusCode::kDataLoss);
  EXPECT_EQ(trained.Encoded(), before);
}

// A network of the same start for each, trained along Gradients and along Grad.
class ProductsOfGradients : public ::testing::Test {
 protected:
  struct Net {
    explicit Net(DType dtype) : context(workers, dtype) {
      Rng rng(3);
      net.Add<LinearLayer>("fc1", context, LinearShape{.in = 37, .out = 50}, rng);
      net.Add<Activation>("tanh", &Tanh);
      net.Add<LinearLayer>("fc2", context, LinearShape{.in = 50, .out = 50}, rng);
      adam.emplace(context, Parameters(net), AdamOptions{.weight_decay = 0.01});
    }
    // `twice`: the second layer is used two times, so that its gradient is a sum.
    Var Loss(std::int64_t batch, bool twice) {
      Rng data(9);
      Tensor x = context.Empty({batch, 37});
      FillUniform(x, data, -1, 1);
      Var y = net.Forward(Constant(context, x), Mode::kTrain);
      const auto parameters = adam->parameters();
      if (twice) y = Linear(y, parameters[2], parameters[3]);
      return Mean(Square(y - 1.0));
    }
    Bytes Encoded() {
      std::vector<NamedTensor> all = State(net);
      for (const NamedTensor& moment : adam->State()) all.push_back(moment);
      return EncodeSafetensors({all, {}}).value();
    }
    Workers workers{2};
    Context context;
    Sequential net;
    std::optional<Adam> adam;
  };
};

TEST_F(ProductsOfGradients, SameBitsAsValues) {
  for (const DType dtype : {DType::kF32, DType::kF64}) {
    for (const std::int64_t batch : {7, 300}) {  // 300: more than ProductAdamStep takes
      for (const bool twice : {false, true}) {
        Net products(dtype), values(dtype);
        for (int step = 0; step < 2; ++step) {
          const auto g = Gradients(products.Loss(batch, twice), products.adam->parameters());
          EXPECT_TRUE(g[0].is_product());
          EXPECT_EQ(g[2].is_product(), !twice);
          EXPECT_FALSE(g[1].is_product());
          EXPECT_TRUE(products.adam->Step(g).ok());
          const auto v = Grad(values.Loss(batch, twice), values.adam->parameters());
          EXPECT_TRUE(values.adam->Step(v).ok());
        }
        EXPECT_EQ(products.Encoded(), values.Encoded()) << batch << twice;
      }
    }
  }
}

TEST_F(ProductsOfGradients, NormIsThatOfValues) {
  Net net(DType::kF32);
  const auto g = Gradients(net.Loss(5, false), net.adam->parameters());
  const auto v = Grad(net.Loss(5, false), net.adam->parameters());
  EXPECT_EQ(GlobalNorm(net.context, g), GlobalNorm(net.context, v));
  EXPECT_TRUE(IsFinite(net.context, g));
}

// A step changes the first matrix, which the gradient of the second one is made of.
TEST_F(Optimisers, ProductsOfParametersAreComputedAtOnce) {
  const auto make = [&](double x) { return Parameter(context_, context_.Full({2, 2}, x)); };
  const Var a = make(2), b = make(3);
  const auto g = Gradients(Sum(Square(Linear(a, b, Var()))), std::vector<Var>{a, b});
  EXPECT_FALSE(g[1].is_product());
}

// Of factors x and 1, both [1, 1].
TEST(FinitenessOfProducts, IsThatOfTheirValues) {
  const Workers workers(1);
  Context context(workers);
  const auto finite = [&](double x, double y) {
    const auto factor = [&](double number) {
      return Constant(context, context.Full({1, 1}, number));
    };
    return IsFinite(context, std::vector<Gradient>{Gradient(factor(x), factor(y))});
  };
  EXPECT_TRUE(finite(2, 3));
  EXPECT_TRUE(finite(3e38, 1));   // computed: too near to the largest float
  EXPECT_FALSE(finite(3e38, 2));  // the product overflows, its factors do not
  EXPECT_FALSE(finite(std::nan(""), 1));
  EXPECT_FALSE(finite(INFINITY, 0));
}

}  // namespace tilegrad::nn::optim_test
