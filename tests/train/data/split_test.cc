// SPDX-License-Identifier: Apache-2.0
#include "train/data/split.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>

namespace tilegrad::train::split_test {

std::vector<ModelInfo> Models(int count, int class_index = 0) {
  std::vector<ModelInfo> models(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    auto& model = models[static_cast<std::size_t>(i)];
    model.id = "m" + std::to_string(i);
    model.class_index = class_index;
    model.geometry = static_cast<std::uint64_t>(i) + 1;
  }
  return models;
}

std::array<int, 3> Count(const std::vector<ModelInfo>& models) {
  std::array<int, 3> counts = {};
  for (const auto& m : models) ++counts[static_cast<std::size_t>(m.split)];
  return counts;
}

TEST(Split, SharesAreKeptAndTheSeedDecides) {
  const SplitRule rule{.test_share = 0.2, .validation_share = 0.1, .seed = 1};
  auto a = Models(50), b = Models(50), c = Models(50);
  SplitModels({"x"}, rule, &a);
  SplitModels({"x"}, rule, &b);
  SplitModels({"x"}, {.test_share = 0.2, .validation_share = 0.1, .seed = 2}, &c);
  EXPECT_EQ(Count(a), (std::array<int, 3>{35, 5, 10}));
  const auto same = [&](const auto& other) {
    return std::equal(a.begin(), a.end(), other.begin(),
                      [](const auto& p, const auto& q) { return p.split == q.split; });
  };
  EXPECT_TRUE(same(b));
  EXPECT_FALSE(same(c));
}

TEST(Split, DoesNotDependOnOtherModelsOrder) {
  const SplitRule rule;
  auto forward = Models(20), backward = Models(20);
  std::reverse(backward.begin(), backward.end());
  SplitModels({"x"}, rule, &forward);
  SplitModels({"x"}, rule, &backward);
  std::reverse(backward.begin(), backward.end());
  for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(forward[i].split, backward[i].split);
}

TEST(Split, EveryClassHasATestModelAndATrainingModel) {
  for (int count = 2; count < 12; ++count) {
    auto models = Models(count);
    SplitModels({"x"}, {.test_share = 0.05, .validation_share = 0.9, .seed = 0}, &models);
    EXPECT_GE(Count(models)[0], 1) << count;
    EXPECT_GE(Count(models)[2], 1) << count;
  }
  auto one = Models(1);
  SplitModels({"x"}, {}, &one);
  EXPECT_EQ(one[0].split, Split::kTrain);
}

TEST(Split, AShareOfNothingIsNone) {
  auto models = Models(10);
  SplitModels({"x"}, {.test_share = 0, .validation_share = 0, .seed = 0}, &models);
  EXPECT_EQ(Count(models), (std::array<int, 3>{10, 0, 0}));
}

TEST(Split, CopiesOfOneMeshStayTogether) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    auto models = Models(30);
    for (std::size_t i = 0; i < models.size(); ++i) models[i].geometry = 1 + i / 3;
    SplitModels({"x"}, {.test_share = 0.2, .validation_share = 0.2, .seed = seed}, &models);
    std::map<std::uint64_t, std::set<Split>> sides;
    for (const auto& m : models) sides[m.geometry].insert(m.split);
    for (const auto& [geometry, splits] : sides) EXPECT_EQ(splits.size(), 1u);
    EXPECT_EQ(Count(models), (std::array<int, 3>{18, 6, 6}));
  }
}

// Ten shapes, the first of 91 liveries: it counts as one, and no shape is divided.
TEST(Split, ShapesStayTogetherAndCountOnce) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    auto models = Models(100);
    for (std::size_t i = 0; i < models.size(); ++i)
      models[i].shape = "s" + std::to_string(i < 91 ? 0 : i - 90);
    SplitModels({"x"}, {.test_share = 0.2, .validation_share = 0.1, .seed = seed}, &models);
    std::map<std::string, std::set<Split>> sides;
    for (const auto& m : models) sides[m.shape].insert(m.split);
    std::array<int, 3> counts = {};
    for (const auto& [shape, splits] : sides) {
      EXPECT_EQ(splits.size(), 1u);
      ++counts[static_cast<std::size_t>(*splits.begin())];
    }
    EXPECT_EQ(counts, (std::array<int, 3>{7, 1, 2}));
  }
}

// a and b have a mesh in common, b and c a shape.
TEST(Split, WhatSharesAMeshOrAShapeIsOneGroup) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    auto models = Models(12);
    for (std::size_t i = 0; i + 2 < models.size(); i += 3) {
      models[i + 1].geometry = models[i].geometry;
      models[i + 1].shape = models[i + 2].shape = "s" + std::to_string(i);
    }
    SplitModels({"x"}, {.test_share = 0.5, .validation_share = 0, .seed = seed}, &models);
    for (std::size_t i = 0; i < models.size(); ++i)
      EXPECT_EQ(models[i].split, models[i - i % 3].split);
    EXPECT_EQ(Count(models), (std::array<int, 3>{6, 0, 6}));
  }
}

TEST(Split, WithoutGeometryEachModelIsItsOwn) {
  auto models = Models(10);
  for (auto& m : models) m.geometry = 0;
  SplitModels({"x"}, {}, &models);
  EXPECT_EQ(Count(models), (std::array<int, 3>{8, 0, 2}));
}

}  // namespace tilegrad::train::split_test
