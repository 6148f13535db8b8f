// SPDX-License-Identifier: Apache-2.0
// Equation 16 with layers that are known by hand, with a critic and with a classifier.
#include "train/losses/feature_l1.h"

#include <gtest/gtest.h>

#include "module_gradient.h"
#include "nn/nn.h"
#include "support/temp_folder.h"
#include "train/models/classifier.h"

namespace tilegrad::train::feature_l1_test {

class FeatureL1 : public testing::Test {
 protected:
  nn::Var Images(const nn::Shape& shape) {
    return nn::RandomParameter(context_, {shape, 0, 1}, rng_);
  }

  Workers workers_{2};
  nn::Context context_{workers_, nn::DType::kF64};
  Rng rng_{6};
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
  const nn::Var predicted = Images({2, 3, 16, 16});
  const nn::Tensor truth = Images({2, 3, 16, 16}).value();
  const auto levels = features(predicted);
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_EQ(levels[0].shape(), (nn::Shape{2, 3, 8, 8}));
  EXPECT_EQ(levels[1].shape(), (nn::Shape{2, 6, 4, 4}));
  ExpectGradientBy(
      {predicted}, [&] { return FeatureL1Loss(features, predicted, truth); }, rng_);
  EXPECT_EQ(FeatureL1Loss(features, predicted, predicted.value()).item(), 0);
}

TEST_F(FeatureL1, IsDifferentiatedThroughAClassifier) {
  ClassifierNetwork network(context_, {.channels = 3, .most = 5, .levels = 3}, 4, 1);
  const FeatureFunction features = [&](const nn::Var& x) {
    return network.Levels(x, nn::Mode::kEval);
  };
  const nn::Var predicted = Images({2, 3, 12, 12});
  const nn::Tensor truth = Images({2, 3, 12, 12}).value();
  ExpectGradientBy(
      {predicted}, [&] { return FeatureL1Loss(features, predicted, truth); }, rng_);
}

TEST_F(FeatureL1, WhatDoesNotFitIsAnError) {
  const FeatureFunction none = [](const nn::Var&) { return std::vector<nn::Var>(); };
  const nn::Var predicted = Images({1, 3, 4, 4});
  EXPECT_FALSE(FeatureL1Loss(none, predicted, context_.Zeros({1, 3, 4, 5})).valid());
  ExpectMessage(context_.TakeStatus(), "[1, 3, 4, 4]", "[1, 3, 4, 5]");
  EXPECT_FALSE(FeatureL1Loss(none, predicted, context_.Zeros({1, 3, 4, 4})).valid());
  ExpectMessage(context_.TakeStatus(), "no layers");
}

// The names and shapes that checkpoints have, and what each level gives.
TEST_F(FeatureL1, ClassifierHasTheLevelsItIsAskedFor) {
  ClassifierNetwork network(context_, {.channels = 4, .most = 10, .levels = 3}, 5, 1);
  const auto levels = network.Levels(Images({2, 3, 16, 16}), nn::Mode::kEval);
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0].shape(), (nn::Shape{2, 4, 16, 16}));
  EXPECT_EQ(levels[1].shape(), (nn::Shape{2, 8, 8, 8}));
  EXPECT_EQ(levels[2].shape(), (nn::Shape{2, 10, 4, 4}));
  double least = 0;
  for (const double x : levels[2].value().span<double>()) least = std::min(least, x);
  EXPECT_LT(least, 0);  // not rectified
  const nn::Var scores = network.Forward(Images({2, 3, 16, 16}), nn::Mode::kEval);
  EXPECT_EQ(scores.shape(), (nn::Shape{2, 5}));
  EXPECT_EQ(nn::CountParameters(network), 9 * (3 * 4 + 4 * 8 + 8 * 10) + 2 * (4 + 8 + 10) + 11 * 5);
  const auto weights = nn::Parameters(network);
  EXPECT_EQ(weights.front().name, "level0.conv.weight");
  EXPECT_EQ(weights.back().name, "head.fc.bias");
}

}  // namespace tilegrad::train::feature_l1_test
