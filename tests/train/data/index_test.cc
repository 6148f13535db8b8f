// SPDX-License-Identifier: Apache-2.0
// Broken datasets: every error names the file and the place.
#include <gtest/gtest.h>

#include "io/npz.h"
#include "support/temp_folder.h"
#include "train/data/build/build.h"

namespace tilegrad::train::index_test {

class IndexTest : public TempFolderTest {
 protected:
  void SetUp() override {
    BuildOptions options;
    options.image_size = 8;
    options.views = 1;
    const StopFlag stop = false;
    ASSERT_TRUE(BuildDataset(*ProceduralSource(1, 0), options, folder_, Workers(1), {}, stop).ok());
  }

  // Replaces the first `from` in a file of the dataset.
  void Edit(const char* file, const std::string& from, const std::string& to) {
    std::string text = ReadText(folder_ / file).value();
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    ASSERT_TRUE(WriteTextAtomic(folder_ / file, text.replace(at, from.size(), to)).ok());
  }
  void ExpectOpenError(const std::vector<std::string>& words) {
    const auto dataset = Dataset::Open(folder_);
    ASSERT_FALSE(dataset.ok());
    for (const auto& word : words) {
      EXPECT_NE(dataset.status().message().find(word), std::string::npos)
          << "\"" << word << "\" is not in: " << dataset.status().message();
    }
  }
};

TEST_F(IndexTest, IsReadableToBeginWith) { EXPECT_TRUE(Dataset::Open(folder_).ok()); }

// Datasets of before have none; a shape of its own is written nowhere.
TEST_F(IndexTest, ShapesAreOptional) {
  auto models = ReadModels(folder_, ReadDatasetInfo(folder_).value()).value();
  EXPECT_EQ(ReadText(ModelsPath(folder_)).value().find("shape"), std::string::npos);
  EXPECT_EQ(CountShapes(models), models.size());
  models[1].shape = "one";
  ASSERT_TRUE(WriteModels(folder_, ReadDatasetInfo(folder_).value(), models).ok());
  const auto again = Dataset::Open(folder_).value();
  EXPECT_EQ(again.models()[1].shape, "one");
  EXPECT_EQ(again.models()[0].shape, "");
  Edit("models.jsonl", "\"shape\":\"one\"", "\"shape\":1");
  ExpectOpenError({"models.jsonl", "line 2", "shape"});
}

TEST_F(IndexTest, MissingFolder) {
  const auto dataset = Dataset::Open(folder_ / "no");
  EXPECT_EQ(dataset.status().code(), StatusCode::kNotFound);
}

TEST_F(IndexTest, BrokenInfoNamesTheLine) {
  Edit("dataset.json", "\"views\":", "\"views\"");
  ExpectOpenError({"dataset.json", "line 5"});
}

TEST_F(IndexTest, InfoKeysOfAnotherTypeOrRange) {
  Edit("dataset.json", "\"views\": 1", "\"views\": \"one\"");
  ExpectOpenError({"dataset.json", "\"views\"", "whole number"});
  Edit("dataset.json", "\"views\": \"one\"", "\"views\": 18446744073709551615");
  ExpectOpenError({"dataset.json", "\"views\"", "[1, 4096]"});
}

TEST_F(IndexTest, AnotherFormat) {
  Edit("dataset.json", "tilegrad-dataset-1", "tilegrad-dataset-9");
  ExpectOpenError({"dataset.json", "tilegrad-dataset-9"});
}

TEST_F(IndexTest, MissingCamera) {
  Edit("dataset.json", "\"camera\"", "\"Camera\"");
  ExpectOpenError({"dataset.json", "\"camera\""});
}

TEST_F(IndexTest, CamerasThatCannotBe) {
  std::string before = ReadText(folder_ / "dataset.json").value();
  const auto expect = [&](const std::string& key, const std::string& value) {
    const auto at = before.find("\"" + key + "\": ") + key.size() + 4;
    ASSERT_NE(before.find(key), std::string::npos);
    std::string text = before;
    ASSERT_TRUE(WriteTextAtomic(folder_ / "dataset.json",
                                text.replace(at, text.find_first_of(",\n", at) - at, value))
                    .ok());
    ExpectOpenError({"dataset.json", "\"camera\"", "\"" + key + "\" is " + value});
  };
  for (const char* fov : {"-1", "0", "180", "1e+300"}) expect("fov_y", fov);
  for (const char* distance : {"0", "-2", "1e+30"}) expect("distance", distance);
  for (const char* elevation : {"91", "-1e+99"}) expect("elevation", elevation);
  expect("half_extent", "0");
  expect("azimuth_step", "1e+300");
}

TEST_F(IndexTest, ModelLinesNameTheirNumber) {
  Edit("models.jsonl", "\"class\":\"lamp\"", "\"class\":\"ship\"");
  ExpectOpenError({"models.jsonl", "line 3", "ship"});
  Edit("models.jsonl", "{\"id\":\"chair-00000\"", "{\"id\":\"../../etc\"");
  ExpectOpenError({"models.jsonl", "line 2", "\"id\""});
  Edit("models.jsonl", "{\"id\":\"car-00000\",", "{\"id\":\"car-00000\"");
  ExpectOpenError({"models.jsonl", "line 1", "JSON"});
}

// The JSON library's error about them is of another type and has no place.
TEST_F(IndexTest, NumbersBeyondDouble) {
  Edit("models.jsonl", "\"source_faces\":", "\"source_faces\":1e999,\"was\":");
  ExpectOpenError({"models.jsonl", "line 1", "1e999"});
  Edit("dataset.json", "\"views\": 1", "\"views\": 1e999");
  ExpectOpenError({"dataset.json", "1e999"});
}

// Copies of such values used up the stack.
TEST_F(IndexTest, ValuesNestedDeeply) {
  const std::string deep = std::string(200'000, '[') + std::string(200'000, ']');
  Edit("dataset.json", "\"fov_y\"", "\"x\": " + deep + ", \"fov_y\"");
  ExpectOpenError({"dataset.json", "nested"});
}

TEST_F(IndexTest, ALineCutByACrash) {
  std::string text = ReadText(folder_ / "models.jsonl").value();
  text.resize(text.size() - 20);
  ASSERT_TRUE(WriteTextAtomic(folder_ / "models.jsonl", text).ok());
  ExpectOpenError({"models.jsonl", "line 5"});
}

TEST_F(IndexTest, TheSameIdTwice) {
  const std::string text = ReadText(folder_ / "models.jsonl").value();
  ASSERT_TRUE(WriteTextAtomic(folder_ / "models.jsonl", text + text).ok());
  ExpectOpenError({"models.jsonl", "line 6", "twice"});
}

TEST_F(IndexTest, NoModels) {
  ASSERT_TRUE(WriteTextAtomic(folder_ / "models.jsonl", "").ok());
  ExpectOpenError({"models.jsonl", "no models"});
}

TEST_F(IndexTest, ModelFilesThatAreNotWhatTheyShould) {
  const auto dataset = Dataset::Open(folder_);
  ASSERT_TRUE(dataset.ok());
  const Path file = dataset->ModelPath(0);
  const auto arrays = io::LoadNpz(file).value();
  const auto expect_error = [&](io::NpzArrays changed, const std::string& name) {
    ASSERT_TRUE(io::SaveNpz(file, changed).ok());
    const auto data = dataset->Load(0);
    ASSERT_FALSE(data.ok());
    EXPECT_NE(data.status().message().find(file.string()), std::string::npos);
    EXPECT_NE(data.status().message().find(name), std::string::npos) << data.status().message();
  };
  auto changed = arrays;
  changed.erase("occupancy");
  expect_error(changed, "occupancy");
  changed = arrays;
  changed["images"].shape = {2, 4, 8, 4};
  expect_error(changed, "images");
  changed = arrays;
  const std::vector<float> nan(9, std::nanf(""));
  changed["points"] = io::MakeNpy<float>({3, 3}, nan);
  expect_error(changed, "points");
  changed = arrays;
  const std::vector<std::int32_t> beyond = {0, 1, 1 << 30};
  changed["mesh_faces"] = io::MakeNpy<std::int32_t>({1, 3}, beyond);
  expect_error(changed, "faces");
  ASSERT_TRUE(WriteTextAtomic(file, "not a zip").ok());
  EXPECT_FALSE(dataset->Load(0).ok());
  EXPECT_FALSE(dataset->LoadImages(0).ok());
}

}  // namespace tilegrad::train::index_test
