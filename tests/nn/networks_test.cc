// SPDX-License-Identifier: Apache-2.0
// The networks: shapes, names, derivatives through the whole of each, and their purpose.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "nn/game.h"
#include "nn/gradient_check.h"
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

TEST_F(Networks, ResidualBlocksDifferentiated) {
  Sequential blocks;
  AddResidualBlock(blocks, "a", context_, 2, rng_);
  AddResidualBlock(blocks, "b", context_, 2, rng_);
  const Var image = Input({2, 2, 5, 6});
  EXPECT_EQ(blocks.Forward(image, Mode::kEval).shape(), image.shape());
  ExpectGradientBy(
      WeightsOf(blocks), [&] { return Mean(Square(blocks.Forward(image, Mode::kTrain) - 1.0)); },
      rng_);
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

}  // namespace tilegrad::nn::networks_test
