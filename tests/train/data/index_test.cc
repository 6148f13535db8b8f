// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "io/npz.h"
#include "support/temp_folder.h"
#include "train/data/build/build.h"
#include "train/data/dataset.h"
#include "train/data/split.h"

namespace tilegrad::train::index_test {

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

// Broken datasets: every error names the file and the place.

class IndexTest : public TempFolderTest {
 protected:
  void SetUp() override {
    BuildOptions options;
    options.image_size = 8;
    options.views = 1;
    ASSERT_TRUE(BuildDataset(*ProceduralSource(1, 0), options, folder_, Workers(1), {}).ok());
  }

  // Replaces the first `from` in a file of the dataset.
  void Edit(const char* file, const std::string& from, const std::string& to) {
    std::string text = ReadText(folder_ / file).value();
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    ASSERT_TRUE(WriteTextAtomic(folder_ / file, text.replace(at, from.size(), to)).ok());
  }
  // The error names the file and has all words.
  void ExpectOpenError(const char* file, const std::vector<std::string>& words) {
    const Status status = Dataset::Open(folder_).status();
    ExpectMessage(status, file);
    for (const std::string& word : words) ExpectIn(status.message(), word);
  }
};

// Datasets of before have none; a shape of its own is written nowhere.
TEST_F(IndexTest, ShapesAreOptional) {
  auto models = ReadModels(folder_, ReadDatasetInfo(folder_).value()).value();
  ExpectNotIn(ReadText(ModelsPath(folder_)).value(), "shape");
  EXPECT_EQ(CountShapes(models), models.size());
  models[1].shape = "one";
  ASSERT_TRUE(WriteModels(folder_, ReadDatasetInfo(folder_).value(), models).ok());
  const auto again = Dataset::Open(folder_).value();
  EXPECT_EQ(again.models()[1].shape, "one");
  EXPECT_EQ(again.models()[0].shape, "");
  Edit("models.jsonl", "\"shape\":\"one\"", "\"shape\":1");
  ExpectOpenError("models.jsonl", {"line 2", "shape"});
}

TEST_F(IndexTest, MissingFolder) {
  const auto dataset = Dataset::Open(folder_ / "no");
  EXPECT_EQ(dataset.status().code(), StatusCode::kNotFound);
}

struct Damage {
  const char* file;
  std::string from, to;
  std::vector<std::string> words;
};

// Numbers beyond double: the JSON library's error is of another type and has no place. Values
// nested deeply: copies of them used up the stack.
TEST_F(IndexTest, DamagedFilesAreNamedWithThePlace) {
  const char *const info = "dataset.json", *const models = "models.jsonl";
  const std::string deep = std::string(200'000, '[') + std::string(200'000, ']');
  const Damage damages[] = {
      {info, "\"views\":", "\"views\"", {"line 5"}},
      {info, "\"views\": 1", "\"views\": \"one\"", {"\"views\"", "whole number"}},
      {info, "\"views\": 1", "\"views\": 18446744073709551615", {"\"views\"", "[1, 4096]"}},
      {info, "\"views\": 1", "\"views\": 1e999", {"1e999"}},
      {info, "tilegrad-dataset-1", "tilegrad-dataset-9", {"tilegrad-dataset-9"}},
      {info, "\"camera\"", "\"Camera\"", {"\"camera\""}},
      {info, "\"fov_y\"", "\"x\": " + deep + ", \"fov_y\"", {"nested"}},
      {models, "\"class\":\"lamp\"", "\"class\":\"ship\"", {"line 3", "ship"}},
      {models, "{\"id\":\"chair-00000\"", "{\"id\":\"../../etc\"", {"line 2", "\"id\""}},
      {models, "{\"id\":\"car-00000\",", "{\"id\":\"car-00000\"", {"line 1", "JSON"}},
      {models, "\"source_faces\":", "\"source_faces\":1e999,\"was\":", {"line 1", "1e999"}},
  };
  for (const Damage& damage : damages) {
    SCOPED_TRACE(damage.to.substr(0, 60));
    const std::string whole = ReadText(folder_ / damage.file).value();
    Edit(damage.file, damage.from, damage.to);
    ExpectOpenError(damage.file, damage.words);
    Write(damage.file, whole);
  }
}

TEST_F(IndexTest, ModelsThatAreCutOrTwiceOrNone) {
  const std::string whole = ReadText(folder_ / "models.jsonl").value();
  Write("models.jsonl", whole.substr(0, whole.size() - 20));  // by a crash
  ExpectOpenError("models.jsonl", {"line 5"});
  Write("models.jsonl", whole + whole);
  ExpectOpenError("models.jsonl", {"line 6", "twice"});
  Write("models.jsonl", std::string());
  ExpectOpenError("models.jsonl", {"no models"});
}

TEST_F(IndexTest, CamerasThatCannotBe) {
  std::string before = ReadText(folder_ / "dataset.json").value();
  const auto expect = [&](const std::string& key, const std::string& value) {
    const auto at = before.find("\"" + key + "\": ") + key.size() + 4;
    ASSERT_NE(before.find(key), std::string::npos);
    std::string text = before;
    Ok(WriteTextAtomic(folder_ / "dataset.json",
                       text.replace(at, text.find_first_of(",\n", at) - at, value)));
    ExpectOpenError("dataset.json", {"\"camera\"", "\"" + key + "\" is " + value});
  };
  for (const char* fov : {"-1", "0", "180", "1e+300"}) expect("fov_y", fov);
  for (const char* distance : {"0", "-2", "1e+30"}) expect("distance", distance);
  for (const char* elevation : {"91", "-1e+99"}) expect("elevation", elevation);
  expect("half_extent", "0");
  expect("azimuth_step", "1e+300");
}

TEST_F(IndexTest, ModelFilesThatAreNotWhatTheyShould) {
  const auto dataset = Ok(Dataset::Open(folder_));
  const Path file = dataset->ModelPath(0);
  const auto arrays = io::LoadNpz(file).value();
  const auto expect_error = [&](const auto& change, const char* name) {
    io::NpzArrays changed = arrays;
    change(changed);
    Ok(io::SaveNpz(file, changed));
    ExpectMessage(dataset->Load(0).status(), file.string(), name);
  };
  const std::vector<float> nan(9, std::nanf(""));
  const std::vector<std::int32_t> beyond = {0, 1, 1 << 30};
  expect_error([](auto& a) { a.erase("occupancy"); }, "occupancy");
  expect_error([](auto& a) { a["images"].shape = {2, 4, 8, 4}; }, "images");
  expect_error([&](auto& a) { a["points"] = io::MakeNpy<float>({3, 3}, nan); }, "points");
  expect_error(
      [&](auto& a) {
        a["mesh_faces"] = io::MakeNpy<std::int32_t>({1, 3}, beyond);
      },
      "faces");
  ASSERT_TRUE(WriteTextAtomic(file, "not a zip").ok());
  EXPECT_FALSE(dataset->Load(0).ok());
  EXPECT_FALSE(dataset->LoadImages(0).ok());
}

}  // namespace tilegrad::train::index_test

namespace tilegrad::train::few_models_test {

std::vector<ModelInfo> Models(int training, int test) {
  std::vector<ModelInfo> out;
  for (int m = 0; m < training + test; ++m) {
    out.emplace_back().id = std::to_string(m);
    out.back().split = m < training ? Split::kTrain : Split::kTest;
  }
  return out;
}

TEST(FewModels, CountsShapesToTrainOn) {
  const int few = static_cast<int>(kFewShapes), streamed = static_cast<int>(kFewStreamedShapes);
  EXPECT_TRUE(AdviceOnFewModels(Models(few - 1, 100), false));
  EXPECT_FALSE(AdviceOnFewModels(Models(few, 0), false));
  EXPECT_TRUE(AdviceOnFewModels(Models(streamed - 1, 100), true));
  EXPECT_FALSE(AdviceOnFewModels(Models(streamed, 0), true));
  std::vector<ModelInfo> liveries = Models(few, 0);
  for (ModelInfo& model : liveries) model.shape = "one";
  EXPECT_TRUE(AdviceOnFewModels(liveries, false)->starts_with("1 training shape is few"));
}

TEST(FewModels, NamesTheRemedies) {
  const std::string fixed = *AdviceOnFewModels(Models(7, 2), false);
  ExpectIn(fixed, "7 training shapes are few:", "--per-class", "stream.share=0.5",
           "schedule.mirrored=0.5", "tilegrad fit");
  const std::string streamed = *AdviceOnFewModels(Models(7, 2), true);
  ExpectNotIn(streamed, "stream.share");
  ExpectIn(streamed, "tilegrad fit");
}

}  // namespace tilegrad::train::few_models_test
