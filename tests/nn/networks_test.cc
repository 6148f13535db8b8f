// SPDX-License-Identifier: Apache-2.0
// The networks: shapes, names, derivatives through the whole of each, and their purpose.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "nn/game.h"
#include "nn/gradient_check.h"
#include "nn/layers.h"
#include "nn/nn.h"
#include "support/temp_folder.h"

namespace tilegrad::nn::networks_test {

class Networks : public ::testing::Test {
 protected:
  Var Input(const Shape& shape) { return RandomParameter(context_, {shape, 0, 1}, rng_); }

  Workers workers_{2};
  Context context_{workers_, DType::kF64};
  Rng rng_{77};
};

// The channels of pix2pix's generator for 256 x 256. Its 4x4 kernels down have 19,532,800 weights,
// the 3x3 ones up 19,615,104; the rest are norms and the three biases without one.
TEST_F(Networks, UNetHasTheChannelsOfPix2Pix) {
  Context context(workers_);
  UNet net(context, {}, rng_);
  std::map<std::string, Shape> shapes;
  for (const NamedTensor& t : State(net)) shapes[t.name] = t.value.shape();
  EXPECT_EQ(shapes.at("level1.down.conv.weight"), (Shape{64, 3, 4, 4}));
  EXPECT_EQ(shapes.at("level8.down.conv.weight"), (Shape{512, 512, 4, 4}));
  EXPECT_EQ(shapes.at("level8.up.conv.weight"), (Shape{512, 512, 3, 3}));
  EXPECT_EQ(shapes.at("level2.up.conv.weight"), (Shape{64, 256, 3, 3}));
  EXPECT_EQ(shapes.at("level1.up.conv.weight"), (Shape{3, 128, 3, 3}));
  EXPECT_EQ(CountParameters(net), 39158339);
}

TEST_F(Networks, UNetDifferentiated) {
  UNet net(context_, {.base = 3, .most = 5, .levels = 3, .output = &Sigmoid}, rng_);
  const Var x = Input({2, 3, 16, 8});
  EXPECT_EQ(net.Encode(x, Mode::kTrain).back().shape(), (Shape{2, 5, 2, 1}));
  EXPECT_EQ(net.Forward(x, Mode::kTrain).shape(), x.shape());
  ExpectGradientBy(
      WeightsOf(net), [&] { return Mean(Square(net.Forward(x, Mode::kTrain) - 0.2)); }, rng_);
  EXPECT_FALSE(net.Forward(Input({1, 3, 6, 8}), Mode::kTrain).valid());
  ExpectIn(context_.TakeStatus().message(), "multiple of 8");
}

TEST_F(Networks, UNetWithoutSkipsAndLarger) {
  UNet net(context_,
           {.base = 3, .most = 5, .levels = 2, .skips = false, .enlarge = 2, .output = &Sigmoid},
           rng_);
  const Var x = Input({2, 3, 8, 8});
  EXPECT_EQ(net.Forward(x, Mode::kTrain).shape(), (Shape{2, 3, 32, 32}));
  ExpectGradientBy(
      WeightsOf(net), [&] { return Mean(Square(net.Forward(x, Mode::kTrain) - 0.2)); }, rng_);
}

// A map without edges has no place that differs from another: what one code gives is of one colour.
TEST_F(Networks, AMapThatWrapsHasNoEdges) {
  UNet net(context_, {.base = 3, .levels = 3, .skips = false, .enlarge = 1}, rng_);
  const Var y = net.Forward(Input({1, 3, 8, 8}), Mode::kEval);
  ASSERT_EQ(y.shape(), (Shape{1, 3, 16, 16}));
  const Var span = ReduceMax(y, {2, 3}) - ReduceMin(y, {2, 3});
  EXPECT_LT(ReduceMax(span, {0, 1}).item(), 1e-12);
  EXPECT_GT(ReduceMax(Abs(y), {0, 1, 2, 3}).item(), 1e-6);
}

// WGAN-GP: d(critic loss + penalty)/d(weights), to 1e-6 of it, for each kind of critic.
TEST_F(Networks, CriticStepWithGradientPenalty) {
  const CriticShape shapes[] = {{.base = 3, .halvings = 2},
                                {.base = 2, .halvings = 2, .padding_mode = PadMode::kCircular}};
  for (const CriticShape& shape : shapes) {
    Critic critic(context_, shape, rng_);
    const Var real = Input({2, 3, 12, 12}), fake = Input({2, 3, 12, 12});
    const auto features = critic.Features(real, Mode::kTrain);
    EXPECT_EQ(features.back().shape(), (Shape{2, 1, 3, 3}));
    ExpectGradientBy(
        WeightsOf(critic),
        [&] {
          return Mean(critic.Forward(fake, Mode::kTrain)) -
                 Mean(critic.Forward(real, Mode::kTrain)) +
                 10.0 * GradientPenalty(critic, Detach(0.3 * real + 0.7 * fake));
        },
        rng_);
    ExpectGradientBy(
        WeightsOf(critic), [&] { return GradientPenalty(critic, Detach(real)); }, rng_);
  }
}

// Of torchvision's names, with two channels everywhere.
std::vector<NamedTensor> SmallVgg16(Context& context, Rng& rng) {
  std::vector<NamedTensor> weights;
  std::int64_t in = 3;
  for (const int index : {0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28}) {
    const std::string name = "features." + std::to_string(index);
    weights.push_back({name + ".weight", context.Empty({2, in, 3, 3})});
    weights.push_back({name + ".bias", context.Empty({2})});
    FillUniform(weights[weights.size() - 2].value, rng, -0.5, 0.5);
    FillUniform(weights.back().value, rng, 0, 0.1);
    in = 2;
  }
  return weights;
}

// The spatial sizes that torchvision's network gives for an image of 64 x 64.
TEST_F(Networks, Vgg16HasTheStagesOfTorchvision) {
  // As a user has them: from a file.
  const Bytes bytes = EncodeSafetensors({SmallVgg16(context_, rng_), {}}).value();
  auto weights = DecodeSafetensors(context_, bytes).value().tensors;
  const auto network = Ok(Vgg16::Load(context_, weights));
  const Var x = Input({1, 3, 64, 64}), y = Input({1, 3, 64, 64});
  const auto features = network->Features(x);
  ASSERT_EQ(features.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(features[i].shape()[2], 64 >> i);
  const Var distance = PerceptualL1(features, network->Features(y));
  EXPECT_GT(distance.item(), 0);
  EXPECT_EQ(PerceptualL1(features, network->Features(Detach(x))).item(), 0);
  EXPECT_EQ(Grad(distance, {x})[0].shape(), x.shape());
  EXPECT_TRUE(context_.status().ok()) << context_.status().message();
  EXPECT_FALSE(PerceptualL1(features, std::span(features).first(1)).valid());
  EXPECT_EQ(context_.TakeStatus().code(), StatusCode::kInvalidArgument);

  weights.pop_back();
  EXPECT_EQ(Vgg16::Load(context_, weights).status().code(), StatusCode::kNotFound);
}

TEST_F(Networks, FeatureWeightsThatDoNotFitAreNamed) {
  auto weights = SmallVgg16(context_, rng_);
  weights[2].value = context_.Zeros({5, 9, 5, 5});
  ExpectMessage(Vgg16::Load(context_, weights).status(),
                "\"features.2.weight\" has shape [5, 9, 5, 5]");
}

// Steps of an adversarial game and of a U-Net in float: same bits for any number of workers.
TEST(NetworksTraining, SameBitsForAnyNumberOfWorkersOver100Steps) {
  Bytes want;
  for (const int count : {1, 2, 7}) {
    const Workers workers(count);
    Game game(workers);
    for (std::uint64_t step = 0; step < 100; ++step) game.Step(step);
    if (want.empty()) want = game.Encoded();
    EXPECT_EQ(game.Encoded(), want) << count;
  }
}

// Layers, initialisers and Adam.

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
  EXPECT_DOUBLE_EQ(norm.running_mean.data<double>()[0], 0.1 * 3);
  EXPECT_DOUBLE_EQ(norm.running_variance.data<double>()[0], 0.9 + 0.1 * 14.0 / 3);  // unbiased
  const Var y = norm.Forward(x, Mode::kEval);
  EXPECT_NEAR(Numbers(y)[3], (6 - 0.3) / std::sqrt(0.9 + 1.4 / 3 + 1e-5), 1e-12);
  EXPECT_DOUBLE_EQ(norm.running_mean.data<double>()[0], 0.1 * 3);  // eval tracks nothing
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
  EXPECT_NEAR(p.item(), 1.0 - 0.1 * 4.0 / (4.0 + 1e-8), 1e-15);
  // Step 2 with g = -2: m = 0.9 0.4 - 0.1 2 = 0.16, v = 0.999 0.016 + 0.001 4.
  ASSERT_TRUE(adam.Step(gradient(-2.0)).ok());
  const double m = 0.16 / 0.19, v = (0.999 * 0.016 + 0.004) / (1 - 0.999 * 0.999);
  EXPECT_NEAR(p.item(), 0.9 - 0.1 * m / (std::sqrt(v) + 1e-8), 1e-9);
  EXPECT_EQ(adam.steps(), 2);
}

TEST(AdamOptimizer, RefusesWhatDoesNotFit) {
  const Workers workers(1);
  Context context(workers);
  Var p = Parameter(context, context.Full({2}, 1.0));
  Adam adam(context, {{"net.p", p}}, {});
  const std::vector<Var> wrong = {Constant(context, context.Full({3}, 1.0))};
  ExpectMessage(adam.Step(wrong), "net.p");
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
  ExpectMessage(LoadState(b, state), "fc.bias");
  state = State(a);
  state[0].value = state[1].value;
  ExpectMessage(LoadState(b, state), "conv.weight");
  EXPECT_EQ(encoded(), before);
}

}  // namespace tilegrad::nn::networks_test
