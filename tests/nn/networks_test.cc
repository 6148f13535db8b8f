// SPDX-License-Identifier: Apache-2.0
// The networks: shapes, names, derivatives through the whole of each, and their purpose.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <memory>

#include "nn/gradient_check.h"
#include "support/temp_folder.h"

namespace tilegrad::nn::networks_test {

class Networks : public ::testing::Test {
 protected:
  Var Input(const Shape& shape) { return RandomParameter(context_, {shape, 0, 1}, rng_); }

  // d(loss)/d(parameters) against differences, along a random direction of all parameters and then
  // of each: to 1e-6 of the slope, and what rounding leaves of a difference of two losses, 16 eps
  // loss / step. The step is small because a rectifier of the thousands must not pass its kink.
  void ExpectGradient(Module& module, const std::function<Var()>& loss) {
    std::vector<Var> parameters;
    for (const NamedVar& p : Parameters(module)) parameters.push_back(p.value);
    const Var value = loss();
    ASSERT_TRUE(value.valid()) << context_.status().message();
    const auto gradient = Grad(value, parameters);
    ASSERT_TRUE(context_.status().ok()) << context_.status().message();
    Inputs direction, none;
    for (const Var& p : parameters) {
      direction.push_back(RandomConstant(context_, p.shape(), rng_));
      none.push_back(Constant(context_, context_.Zeros(p.shape())));
    }
    constexpr double kStep = 1e-6;
    const double rounding = 16 * 0x1.0p-52 * std::abs(value.item()) / kStep;
    const auto check = [&](const Inputs& along) {
      const double slope = Slope([&](const Inputs& moved) { return At(parameters, moved, loss); },
                                 parameters, along, kStep);
      EXPECT_NEAR(Dot(gradient, along), slope, 1e-6 * std::abs(slope) + rounding);
      return slope;
    };
    EXPECT_GT(std::abs(check(direction)), 1000 * rounding);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      Inputs one = none;
      one[i] = direction[i];
      check(one);
    }
  }

  // The loss with other values of the parameters.
  double At(std::vector<Var> parameters, const Inputs& values, const std::function<Var()>& loss) {
    std::vector<Tensor> before;
    for (std::size_t i = 0; i < values.size(); ++i) {
      before.push_back(context_.Copy(parameters[i].value()));
      std::memcpy(parameters[i].value().raw(), values[i].value().raw(), before[i].bytes());
    }
    const double result = loss().item();
    for (std::size_t i = 0; i < values.size(); ++i) {
      std::memcpy(parameters[i].value().raw(), before[i].raw(), before[i].bytes());
    }
    return result;
  }

  Workers workers_{2};
  Context context_{workers_, DType::kF64};
  Rng rng_{77};
};

// pix2pix's generator for 256 x 256 has 54.41 million parameters with batch norm, as its authors'
// code counts them; with the default instance norm ours are of the same shapes.
TEST_F(Networks, UNetHasTheShapesOfPix2Pix) {
  Context context(workers_);
  UNet net(context, {}, rng_);
  std::map<std::string, Shape> shapes;
  for (const NamedTensor& t : State(net)) shapes[t.name] = t.value.shape();
  EXPECT_EQ(shapes.at("level1.down.conv.weight"), (Shape{64, 3, 4, 4}));
  EXPECT_EQ(shapes.at("level8.down.conv.weight"), (Shape{512, 512, 4, 4}));
  EXPECT_EQ(shapes.at("level8.up.conv.weight"), (Shape{512, 512, 4, 4}));
  EXPECT_EQ(shapes.at("level2.up.conv.weight"), (Shape{256, 64, 4, 4}));
  EXPECT_EQ(shapes.at("level1.up.conv.weight"), (Shape{128, 3, 4, 4}));
  EXPECT_NEAR(static_cast<double>(CountParameters(net)), 54.41e6, 0.02e6);
}

TEST_F(Networks, UNetDifferentiated) {
  for (const bool resize : {false, true}) {
    for (const Norm norm : {Norm::kInstance, Norm::kBatch}) {
      UNet net(
          context_,
          {.base = 3, .most = 5, .levels = 3, .norm = norm, .resize = resize, .output = &Sigmoid},
          rng_);
      const Var x = Input({2, 3, 16, 8});
      const UNet::Result result = net.Run(x, Mode::kTrain);
      EXPECT_EQ(result.image.shape(), x.shape());
      EXPECT_EQ(result.code.shape(), (Shape{2, 5, 2, 1}));
      ExpectGradient(net, [&] { return Mean(Square(net.Forward(x, Mode::kTrain) - 0.2)); });
    }
  }
  UNet map(context_,
           {.base = 3,
            .most = 5,
            .levels = 2,
            .resize = true,
            .skips = false,
            .enlarge = 2,
            .wrap = true,
            .output = &Sigmoid},
           rng_);
  EXPECT_EQ(map.Forward(Input({2, 3, 8, 8}), Mode::kTrain).shape(), (Shape{2, 3, 32, 32}));
  const Var image = Input({2, 3, 8, 8});
  ExpectGradient(map, [&] { return Mean(Square(map.Forward(image, Mode::kTrain) - 0.2)); });
  UNet net(context_, {.base = 2, .levels = 2}, rng_);
  EXPECT_FALSE(net.Forward(Input({1, 3, 6, 8}), Mode::kTrain).valid());
  EXPECT_NE(context_.TakeStatus().message().find("multiple of 4"), std::string::npos);
}

// A map without edges has no place that differs from another: what one code gives is of one colour.
// With zeros around it, it is not.
TEST_F(Networks, AMapThatWrapsHasNoEdges) {
  for (const bool wrap : {false, true}) {
    UNet net(context_,
             {.base = 3,
              .levels = 3,
              .norm = Norm::kNone,
              .resize = true,
              .skips = false,
              .enlarge = 1,
              .wrap = wrap},
             rng_);
    const Var y = net.Forward(Input({1, 3, 8, 8}), Mode::kTrain);
    ASSERT_EQ(y.shape(), (Shape{1, 3, 16, 16}));
    const Var span = ReduceMax(y, {2, 3}) - ReduceMin(y, {2, 3});
    EXPECT_EQ(ReduceMax(span, {0, 1}).item() < 1e-12, wrap);
  }
}

TEST_F(Networks, LightHeadHasSixLayers) {
  Sequential net;
  AddLightHead(net, context_, {.in = 5, .width = 7, .out = 3}, rng_);
  EXPECT_EQ(Parameters(net).size(), 2u * 6u);
  const Var x = Input({4, 5});
  EXPECT_EQ(net.Forward(x, Mode::kEval).shape(), (Shape{4, 3}));
  ExpectGradient(net, [&] { return Mean(Square(net.Forward(x, Mode::kTrain) - 1.0)); });
}

TEST_F(Networks, MlpAndResidualBlocksDifferentiated) {
  Sequential mlp;
  AddMlp(mlp, context_, {.widths = {4, 9, 2}, .activation = &Tanh}, rng_);
  EXPECT_EQ(Parameters(mlp).size(), 4u);
  const Var x = Input({5, 4});
  ExpectGradient(mlp, [&] { return Mean(Square(mlp.Forward(x, Mode::kTrain) - 1.0)); });
  Sequential blocks;
  AddResidualBlock(blocks, "a", context_, {.in = 2, .out = 3, .padding_mode = PadMode::kCircular},
                   rng_);
  AddResidualBlock(blocks, "b", context_, {.in = 3, .out = 3, .norm = Norm::kLayer}, rng_);
  const Var image = Input({2, 2, 5, 6});
  EXPECT_EQ(blocks.Forward(image, Mode::kEval).shape(), (Shape{2, 3, 5, 6}));
  ExpectGradient(blocks, [&] { return Mean(Square(blocks.Forward(image, Mode::kTrain) - 1.0)); });
}

TEST_F(Networks, GeneratorDifferentiated) {
  Generator net(context_, {.noise = 6, .out = 3, .base = 2, .doublings = 2}, rng_);
  const Var noise = Input({3, 6});
  const Var image = net.Forward(noise, Mode::kTrain);
  EXPECT_EQ(image.shape(), (Shape{3, 3, 16, 16}));
  ExpectGradient(net, [&] { return Mean(Square(net.Forward(noise, Mode::kTrain) - 0.5)); });
}

// WGAN-GP: d(critic loss + penalty)/d(weights), to 1e-6 of it, for each kind of critic.
TEST_F(Networks, CriticStepWithGradientPenalty) {
  const CriticShape shapes[] = {
      {.base = 3, .halvings = 2},
      {.base = 3, .halvings = 2, .norm = Norm::kLayer},
      {.base = 2, .halvings = 2, .norm = Norm::kInstance, .padding_mode = PadMode::kCircular}};
  for (const CriticShape& shape : shapes) {
    Critic critic(context_, shape, rng_);
    const Var real = Input({2, 3, 12, 12}), fake = Input({2, 3, 12, 12});
    const auto features = critic.Features(real, Mode::kTrain);
    EXPECT_EQ(features.back().shape(), (Shape{2, 1, 3, 3}));
    ExpectGradient(critic, [&] {
      return Mean(critic.Forward(fake, Mode::kTrain)) - Mean(critic.Forward(real, Mode::kTrain)) +
             10.0 * GradientPenalty(critic, Detach(0.3 * real + 0.7 * fake));
    });
    ExpectGradient(critic, [&] { return GradientPenalty(critic, Detach(real)); });
  }
}

// Spectral norm holds a critic's layers to slope 1, whatever its weights: 100 times larger ones
// give the same scores.
TEST_F(Networks, SpectralCriticIgnoresTheScaleOfItsWeights) {
  Critic critic(context_, {.base = 3, .halvings = 2, .spectral = true}, rng_);
  const Var x = Input({1, 3, 8, 8});
  for (NamedVar& p : Parameters(critic)) {
    if (p.value.shape().rank() == 1) FillConstant(p.value.value(), 0.0);
  }
  const Var before = critic.Forward(x, Mode::kEval);
  FillWeights(critic, [](Tensor& w) {
    for (double& v : w.span<double>()) v *= 100;
  });
  const Var after = critic.Forward(x, Mode::kEval);
  for (std::size_t i = 0; i < before.value().elements(); ++i) {
    const double want = before.value().data<double>()[i];
    EXPECT_NEAR(after.value().data<double>()[i], want, 1e-13 * std::abs(want));
  }
  ExpectGradient(critic, [&] { return Mean(Square(critic.Forward(x, Mode::kEval) - 1.0)); });
}

TEST_F(Networks, SpectralStepsConverge) {
  Conv2dLayer layer(context_, {.in = 3, .out = 5, .spectral = true}, rng_);
  const Var x = Input({1, 3, 4, 4});
  Var last;
  for (int i = 0; i < 200; ++i) last = layer.Forward(x, Mode::kTrain);
  const Tensor before = State(layer)[2].value;
  EXPECT_EQ(State(layer)[2].name, "spectral_u");
  const Tensor kept = context_.Copy(before);
  layer.Forward(x, Mode::kTrain);
  for (std::size_t i = 0; i < kept.elements(); ++i) {
    EXPECT_NEAR(before.data<double>()[i], kept.data<double>()[i], 1e-6);
  }
}

// The matrix of a transposed convolution has a row for each output too: here of lengths 3 and 4,
// while its one row for the input has length 5.
TEST_F(Networks, SpectralNormOfATransposedConvolution) {
  ConvTranspose2dLayer layer(
      context_, {.in = 1, .out = 2, .kernel = 2, .bias = false, .spectral = true}, rng_);
  FillConstant(layer.weight.value(), 0);
  layer.weight.value().data<double>()[0] = 3;
  layer.weight.value().data<double>()[5] = 4;
  EXPECT_EQ(State(layer)[1].value.shape(), (Shape{2}));
  const Var x = Constant(context_, context_.Full({1, 1, 1, 1}, 1));
  Var y;
  for (int i = 0; i < 100; ++i) y = layer.Forward(x, Mode::kTrain);
  EXPECT_NEAR(y.value().data<double>()[0], 0.75, 1e-12);
  EXPECT_NEAR(y.value().data<double>()[5], 1, 1e-12);
  ExpectGradient(layer, [&] { return Mean(Square(layer.Forward(x, Mode::kEval))); });
}

// Files from before there was spectral_v: sigma is |W^T u|, as it was then. W = [[3, 0], [0, 4]]
// and u = (0.6, 0.8) give W^T u = (1.8, 3.2).
TEST_F(Networks, SpectralStateWithoutTheSecondVector) {
  for (const bool transposed : {false, true}) {
    const ConvShape shape{.in = 2, .out = 2, .kernel = 1, .bias = false, .spectral = true};
    std::unique_ptr<Module> layer;
    if (transposed) layer = std::make_unique<ConvTranspose2dLayer>(context_, shape, rng_);
    if (!transposed) layer = std::make_unique<Conv2dLayer>(context_, shape, rng_);
    Tensor weight = context_.Zeros({2, 2, 1, 1}), u = context_.Zeros({2});
    weight.data<double>()[0] = 3, weight.data<double>()[3] = 4;
    u.data<double>()[0] = 0.6, u.data<double>()[1] = 0.8;
    const Status loaded = LoadState(*layer, {{"weight", weight}, {"spectral_u", u}});
    ASSERT_TRUE(loaded.ok()) << loaded.message();
    const Var y = layer->Forward(Constant(context_, context_.Full({1, 2, 1, 1}, 1)), Mode::kEval);
    const double sigma = std::hypot(1.8, 3.2);
    EXPECT_NEAR(y.value().data<double>()[0], 3 / sigma, 1e-15);
    EXPECT_NEAR(y.value().data<double>()[1], 4 / sigma, 1e-15);
    // What was always there is still missed, and a second vector that is there is taken.
    ExpectMessage(LoadState(*layer, {{"weight", weight}, {"spectral_v", u}}), "spectral_u");
    ASSERT_TRUE(LoadState(*layer, {{"weight", weight}, {"spectral_u", u}, {"spectral_v", u}}).ok());
    EXPECT_EQ(std::as_const(State(*layer)[2].value).data<double>()[0], 0.6);
  }
}

// A network of torchvision's names with few channels.
struct SmallFeatures {
  explicit SmallFeatures(Context& c, Rng& r) : context(c), rng(r) {}
  void Conv(const std::string& name, std::int64_t out, std::int64_t in, std::int64_t kernel) {
    Tensor weight = context.Empty({out, in, kernel, kernel}), bias = context.Empty({out});
    FillHe(weight, rng);
    FillUniform(bias, rng, -0.1, 0.1);
    weights.push_back({"features." + name + ".weight", weight});
    weights.push_back({"features." + name + ".bias", bias});
  }
  void Fire(const std::string& name, std::int64_t in) {
    Conv(name + ".squeeze", 2, in, 1);
    Conv(name + ".expand1x1", 2, 2, 1);
    Conv(name + ".expand3x3", 2, 2, 3);
  }
  Context& context;
  Rng& rng;
  std::vector<NamedTensor> weights;
};

std::vector<NamedTensor> SmallAlexNet(Context& context, Rng& rng) {
  SmallFeatures f(context, rng);
  f.Conv("0", 4, 3, 11), f.Conv("3", 5, 4, 5), f.Conv("6", 6, 5, 3);
  f.Conv("8", 5, 6, 3), f.Conv("10", 4, 5, 3);
  return f.weights;
}

std::vector<NamedTensor> SmallVgg16(Context& context, Rng& rng) {
  SmallFeatures f(context, rng);
  const std::vector<int> indices = {0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28};
  std::int64_t in = 3;
  for (const int index : indices) {
    f.Conv(std::to_string(index), 2, in, 3);
    in = 2;
  }
  return f.weights;
}

std::vector<NamedTensor> SmallSqueezeNet(Context& context, Rng& rng) {
  SmallFeatures f(context, rng);
  f.Conv("0", 3, 3, 3);
  f.Fire("3", 3);
  for (const char* name : {"4", "6", "7", "9", "10", "11", "12"}) f.Fire(name, 4);
  return f.weights;
}

// The spatial sizes that torchvision's networks give for an image of 64 x 64.
TEST_F(Networks, FeatureExtractors) {
  struct Case {
    FeatureKind kind;
    std::vector<NamedTensor> (*make)(Context&, Rng&);
    std::vector<std::int64_t> sides;
  };
  const Case cases[] = {{FeatureKind::kAlexNet, &SmallAlexNet, {15, 7, 3, 3, 3}},
                        {FeatureKind::kVgg16, &SmallVgg16, {64, 32, 16, 8, 4}},
                        {FeatureKind::kSqueezeNet, &SmallSqueezeNet, {31, 15, 7, 3, 3, 3, 3}}};
  for (const Case& c : cases) {
    auto weights = c.make(context_, rng_);
    // As a user has them: from a file.
    const Bytes bytes = EncodeSafetensors({weights, {}}).value();
    weights = DecodeSafetensors(context_, bytes).value().tensors;
    const auto network = FeatureNetwork::Load(context_, c.kind, weights);
    ASSERT_TRUE(network.ok()) << network.status().message();
    const Var x = Input({1, 3, 64, 64}), y = Input({1, 3, 64, 64});
    const auto features = network->Features(x);
    ASSERT_EQ(features.size(), c.sides.size());
    for (std::size_t i = 0; i < c.sides.size(); ++i) {
      EXPECT_EQ(features[i].shape()[2], c.sides[i]) << i;
    }
    const Var distance = PerceptualL1(features, network->Features(y));
    EXPECT_GT(distance.item(), 0);
    EXPECT_EQ(PerceptualL1(features, network->Features(Detach(x))).item(), 0);
    EXPECT_EQ(Grad(distance, {x})[0].shape(), x.shape());
    EXPECT_TRUE(context_.status().ok()) << context_.status().message();
    EXPECT_FALSE(PerceptualL1(features, std::span(features).first(1)).valid());
    EXPECT_EQ(context_.TakeStatus().code(), StatusCode::kInvalidArgument);

    weights.pop_back();
    EXPECT_EQ(FeatureNetwork::Load(context_, c.kind, weights).status().code(),
              StatusCode::kNotFound);
  }
}

TEST_F(Networks, FeatureWeightsThatDoNotFitAreNamed) {
  auto weights = SmallAlexNet(context_, rng_);
  weights[2].value = context_.Zeros({5, 9, 5, 5});
  const auto network = FeatureNetwork::Load(context_, FeatureKind::kAlexNet, weights);
  EXPECT_NE(network.status().message().find("\"features.3.weight\" has shape [5, 9, 5, 5]"),
            std::string::npos)
      << network.status().message();
}

TEST_F(Networks, Initialisers) {
  Tensor w = context_.Empty({40, 30, 5, 5});
  const auto variance = [&] {
    double sum = 0;
    for (const double v : w.span<double>()) sum += v * v;
    return sum / static_cast<double>(w.elements());
  };
  // 30,000 draws: a variance is good to about sqrt(2 / 30000) = 0.8 %; six of them are allowed.
  FillHe(w, rng_, 0.2);
  EXPECT_NEAR(variance(), 2 / (1.04 * 750), 0.05 * 2 / (1.04 * 750));
  FillGlorot(w, rng_);
  EXPECT_NEAR(variance(), 2.0 / (750 + 1000), 0.05 * 2.0 / (750 + 1000));
}

}  // namespace tilegrad::nn::networks_test
