// SPDX-License-Identifier: Apache-2.0
// Equation 15: signs and penalty on critics whose figures are known by hand; the critic's step with
// its second derivative, and the generator's through the renderer, against differences in double.
#include "train/losses/wgan_gp.h"

#include <gtest/gtest.h>

#include "nn/gradient_check.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"
#include "train/losses/l1.h"
#include "train/models/classifier.h"
#include "train/models/render_op.h"

namespace tilegrad::train::wgan_gp_test {

// D(x) = sum of x^2: its gradient is 2 x, its norm 2 |x|.
class SquareCritic : public nn::Module {
 public:
  nn::Var Forward(const nn::Var& x, nn::Mode) override { return nn::Sum(nn::Square(x), {1}); }
  void Visit(const std::string&, nn::ModuleVisitor&) override {}
};

class WganGp : public testing::Test {
 protected:
  nn::Var Rows(const nn::Shape& shape, const std::vector<double>& values) {
    return nn::Constant(context_, context_.From(shape, std::span<const double>(values)));
  }
  nn::Var Images(const nn::Shape& shape) {
    return nn::Detach(nn::RandomParameter(context_, {shape, 0, 1}, rng_));
  }

  Workers workers_{2};
  nn::Context context_{workers_, nn::DType::kF64};
  Rng rng_{5};
};

// D(x) = 3 x_1 + 4 x_2 + 1 has the gradient (3, 4) everywhere, of norm 5.
TEST_F(WganGp, LinearCriticByHand) {
  nn::LinearLayer critic(context_, {.in = 2, .out = 1}, rng_);
  critic.weight = nn::Parameter(context_, Rows({1, 2}, {3, 4}).value());
  critic.bias = nn::Parameter(context_, Rows({1}, {1}).value());
  const nn::Var real = Rows({2, 2}, {1, 0, 0, 1}), fake = Rows({2, 2}, {0, 0, 1, 1});
  for (const PenaltyPlace place : {PenaltyPlace::kRendered, PenaltyPlace::kInterpolates}) {
    const CriticLoss loss = WganCriticLoss(critic, real, fake, {0.5, place}, rng_);
    ASSERT_TRUE(context_.status().ok()) << context_.status().message();
    EXPECT_NEAR(loss.wasserstein.item(), (4.0 + 5) / 2 - (1.0 + 8) / 2, 1e-12);
    EXPECT_NEAR(loss.penalty.item(), 16, 1e-9);
    EXPECT_NEAR(loss.total.item(), 0 + 0.5 * 16, 1e-9);
    // d = -(mean real - mean fake) + lambda 2 (5 - 1) w / 5; the means are equal.
    const auto d = nn::Grad(loss.total, {critic.weight})[0];
    EXPECT_NEAR(d.value().data<double>()[0], 0.5 * 8 * 3 / 5, 1e-9);
    EXPECT_NEAR(d.value().data<double>()[1], 0.5 * 8 * 4 / 5, 1e-9);
  }
  EXPECT_NEAR(WganGeneratorLoss(critic, fake).item(), -4.5, 1e-12);
}

// The critic goes where real scores more; the generator where its images do.
TEST_F(WganGp, TheTwoPullApart) {
  nn::LinearLayer critic(context_, {.in = 1, .out = 1, .bias = false}, rng_);
  const nn::Var real = Rows({1, 1}, {2});
  const nn::Var fake = nn::Parameter(context_, Rows({1, 1}, {1}).value());
  const CriticLoss loss = WganCriticLoss(critic, real, fake, {.penalty = 0}, rng_);
  EXPECT_FALSE(loss.penalty.valid());
  EXPECT_EQ(nn::Grad(loss.total, {critic.weight})[0].item(), -1);  // down the loss: weight rises
  const double weight = critic.weight.item();
  EXPECT_EQ(nn::Grad(WganGeneratorLoss(critic, fake), {fake})[0].item(), -weight);
}

TEST_F(WganGp, OneNormForEachSampleAtTheRenderedImage) {
  SquareCritic critic;
  const nn::Var real = Rows({2, 2}, {9, 9, 9, 9}), fake = Rows({2, 2}, {0.3, 0.4, 0, 1});
  const CriticLoss loss = WganCriticLoss(critic, real, fake, {.penalty = 1}, rng_);
  EXPECT_NEAR(loss.penalty.item(), (0.0 + 1) / 2, 1e-9);  // norms 1 and 2
}

TEST_F(WganGp, InterpolatesLieBetween) {
  SquareCritic critic;
  const nn::Var real = Rows({2, 1}, {3, 3}), fake = Rows({2, 1}, {1, 1});
  Rng drawn(8), again(8);
  const CriticLoss loss =
      WganCriticLoss(critic, real, fake, {1, PenaltyPlace::kInterpolates}, drawn);
  double want = 0;
  for (int i = 0; i < 2; ++i) want += std::pow(2 * (1 + again.Uniform() * 2) - 1, 2) / 2;
  EXPECT_NEAR(loss.penalty.item(), want, 1e-9);
}

TEST_F(WganGp, PlacesHaveNames) {
  EXPECT_EQ(*PenaltyPlaceOf("rendered"), PenaltyPlace::kRendered);
  EXPECT_EQ(*PenaltyPlaceOf("interpolates"), PenaltyPlace::kInterpolates);
  ExpectMessage(PenaltyPlaceOf("real").status(), "\"real\"", "\"rendered\"", "\"interpolates\"");
}

TEST_F(WganGp, ShapesThatDoNotFitAreErrors) {
  SquareCritic critic;
  EXPECT_FALSE(
      WganCriticLoss(critic, Rows({1, 2}, {0, 0}), Rows({2, 1}, {0, 0}), {}, rng_).total.valid());
  ExpectMessage(context_.TakeStatus(), "[1, 2]", "[2, 1]");
}

// A small coloured sphere, drawn in double: images of the renderer, whose way back is the tape's.
class WganGpThroughRenderer : public WganGp {
 protected:
  WganGpThroughRenderer() : mesh_(Icosphere(1, 0.4f)), renderer_(workers_) {
    std::vector<double> positions, colors;
    for (const glm::vec3& p : mesh_.positions) {
      for (int k = 0; k < 3; ++k) {
        positions.push_back(static_cast<double>(p[k]) + rng_.Uniform(-0.02, 0.02));
        colors.push_back(rng_.Uniform(0.2, 0.9));
      }
    }
    const auto vertices = static_cast<std::int64_t>(mesh_.positions.size());
    const auto leaf = [&](const std::vector<double>& values) {
      return nn::Parameter(context_,
                           context_.From({1, vertices, 3}, std::span<const double>(values)));
    };
    positions_ = leaf(positions);
    colors_ = leaf(colors);
  }
  // [1, 3, 16, 16], lit up by alpha, so that positions matter at the outline, too.
  nn::Var Draw() {
    RenderOptions options;
    options.width = options.height = 16;
    options.delta = 1 / 50.0;
    const Camera camera = OrbitCamera({40, 16, 16}, 20, 20, 1.5);
    const RenderedImages images =
        RenderScenes(renderer_, {.positions = positions_, .colors = colors_},
                     {.faces = {mesh_.faces[0].data(), 3 * mesh_.faces.size()},
                      .cameras = {camera},
                      .options = options});
    return images.colors + 0.3 * nn::Reshape(images.alpha, {1, 1, 16, 16});
  }

  Mesh mesh_;
  SceneRenderer renderer_;
  nn::Var positions_, colors_;
};

// The second derivative: the penalty is a gradient, and is differentiated by the critic's weights.
TEST_F(WganGpThroughRenderer, CriticStepIsDifferentiated) {
  nn::Critic critic(context_, {.base = 3, .halvings = 2}, rng_);
  const nn::Var real = Images({1, 3, 16, 16}), fake = Draw();
  for (const PenaltyPlace place : {PenaltyPlace::kRendered, PenaltyPlace::kInterpolates}) {
    const auto loss = [&](const nn::Var CriticLoss::*part) {
      Rng rng(3);  // the same interpolate each time
      return WganCriticLoss(critic, real, fake, {10, place}, rng).*part;
    };
    nn::ExpectGradientBy(
        nn::WeightsOf(critic), [&] { return loss(&CriticLoss::total); }, rng_);
    nn::ExpectGradientBy(
        nn::WeightsOf(critic), [&] { return loss(&CriticLoss::penalty); }, rng_);
  }
}

TEST_F(WganGpThroughRenderer, GeneratorStepIsDifferentiated) {
  nn::Critic critic(context_, {.base = 3, .halvings = 2}, rng_);
  nn::ExpectGradientBy(
      {positions_, colors_}, [&] { return WganGeneratorLoss(critic, Draw()); }, rng_);
}

// Equation 16 with layers that are known by hand, with a critic and with a classifier.
class FeatureL1 : public WganGp {
 protected:
  nn::Var Pictures(const nn::Shape& shape) {
    return nn::RandomParameter(context_, {shape, 0, 1}, rng_);
  }
};

// Each layer is divided by its own number of elements: a layer of one number counts as much as one
// of many.
TEST_F(FeatureL1, SumOfMeansByHand) {
  const FeatureFunction features = [](const nn::Var& x) {
    return std::vector<nn::Var>{x, 10.0 * nn::Slice(x, 1, 0, 1)};
  };
  const nn::Tensor truth = context_.From({1, 2}, std::span<const double>({1.0, 2.0}));
  const nn::Var predicted =
      nn::Parameter(context_, context_.From({1, 2}, std::span<const double>({1.5, 1.0})));
  const nn::Var loss = FeatureL1Loss(features, predicted, truth);
  EXPECT_NEAR(loss.item(), (0.5 + 1) / 2 + 10 * 0.5, 1e-12);
  const nn::Var d = nn::Grad(loss, {predicted})[0];
  EXPECT_NEAR(d.value().data<double>()[0], 0.5 + 10, 1e-12);
  EXPECT_NEAR(d.value().data<double>()[1], -0.5, 1e-12);
}

TEST_F(FeatureL1, MatchesTheCriticsLevelsButNotItsScores) {
  nn::Critic critic(context_, {.base = 3, .halvings = 2}, rng_);
  const FeatureFunction features = FeaturesOf(critic);
  const nn::Var predicted = Pictures({2, 3, 16, 16});
  const nn::Tensor truth = Pictures({2, 3, 16, 16}).value();
  const auto levels = features(predicted);
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_EQ(levels[0].shape(), (nn::Shape{2, 3, 8, 8}));
  EXPECT_EQ(levels[1].shape(), (nn::Shape{2, 6, 4, 4}));
  nn::ExpectGradientBy(
      {predicted}, [&] { return FeatureL1Loss(features, predicted, truth); }, rng_);
  EXPECT_EQ(FeatureL1Loss(features, predicted, predicted.value()).item(), 0);
}

TEST_F(FeatureL1, IsDifferentiatedThroughAClassifier) {
  ClassifierNetwork network(context_, {.channels = 3, .most = 5, .levels = 3}, 4, 1);
  const FeatureFunction features = [&](const nn::Var& x) {
    return network.Levels(x, nn::Mode::kEval);
  };
  const nn::Var predicted = Pictures({2, 3, 12, 12});
  const nn::Tensor truth = Pictures({2, 3, 12, 12}).value();
  nn::ExpectGradientBy(
      {predicted}, [&] { return FeatureL1Loss(features, predicted, truth); }, rng_);
}

TEST_F(FeatureL1, WhatDoesNotFitIsAnError) {
  const FeatureFunction none = [](const nn::Var&) { return std::vector<nn::Var>(); };
  const nn::Var predicted = Pictures({1, 3, 4, 4});
  EXPECT_FALSE(FeatureL1Loss(none, predicted, context_.Zeros({1, 3, 4, 5})).valid());
  ExpectMessage(context_.TakeStatus(), "[1, 3, 4, 4]", "[1, 3, 4, 5]");
  EXPECT_FALSE(FeatureL1Loss(none, predicted, context_.Zeros({1, 3, 4, 4})).valid());
  ExpectMessage(context_.TakeStatus(), "no layers");
}

// The names and shapes that checkpoints have, and what each level gives.
TEST_F(FeatureL1, ClassifierHasTheLevelsItIsAskedFor) {
  ClassifierNetwork network(context_, {.channels = 4, .most = 10, .levels = 3}, 5, 1);
  const auto levels = network.Levels(Pictures({2, 3, 16, 16}), nn::Mode::kEval);
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0].shape(), (nn::Shape{2, 4, 16, 16}));
  EXPECT_EQ(levels[1].shape(), (nn::Shape{2, 8, 8, 8}));
  EXPECT_EQ(levels[2].shape(), (nn::Shape{2, 10, 4, 4}));
  double least = 0;
  for (const double x : levels[2].value().span<double>()) least = std::min(least, x);
  EXPECT_LT(least, 0);  // not rectified
  const nn::Var scores = network.Forward(Pictures({2, 3, 16, 16}), nn::Mode::kEval);
  EXPECT_EQ(scores.shape(), (nn::Shape{2, 5}));
  EXPECT_EQ(nn::CountParameters(network), 9 * (3 * 4 + 4 * 8 + 8 * 10) + 2 * (4 + 8 + 10) + 11 * 5);
  const auto weights = nn::Parameters(network);
  EXPECT_EQ(weights.front().name, "level0.conv.weight");
  EXPECT_EQ(weights.back().name, "head.fc.bias");
}

}  // namespace tilegrad::train::wgan_gp_test
