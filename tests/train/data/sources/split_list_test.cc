// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/split_list.h"

#include <gtest/gtest.h>

#include "support/temp_folder.h"

namespace tilegrad::train::split_list_test {

class SplitListTest : public TempFolderTest {
 protected:
  SplitList Read(const std::string& name, const std::string& text) const {
    return Ok(SplitList::Read({Write(name, text)})).value();
  }
  static void ExpectSplit(const SplitList& list, const char* synset, const char* model,
                          std::optional<Split> split) {
    const Listing listing = list.Of(synset, model);
    EXPECT_EQ(listing.used, split.has_value()) << synset << "/" << model;
    EXPECT_EQ(listing.split, split) << synset << "/" << model;
  }
};

TEST_F(SplitListTest, WithoutAListEverythingIsUsed) {
  const Listing listing = Ok(SplitList::Read({}))->Of("03001627", "a");
  EXPECT_TRUE(listing.used);
  EXPECT_FALSE(listing.split);
}

TEST_F(SplitListTest, LinesOfAModelAndItsSplit) {
  const SplitList list =
      Read("list.txt", "03001627/a train\r\n\n03001627/b val\n02958343/a test\n");
  EXPECT_EQ(list.size(), 3u);
  ExpectSplit(list, "03001627", "a", Split::kTrain);
  ExpectSplit(list, "03001627", "b", Split::kValidation);
  ExpectSplit(list, "02958343", "a", Split::kTest);
  ExpectSplit(list, "02958343", "b", std::nullopt);
}

// Some models of Pixel2Mesh's have views in both files.
TEST_F(SplitListTest, Pixel2MeshListsViews) {
  const Path train = Write("train_list.txt",
                           "Data/ShapeNetP2M/03001627/a/rendering/00.dat\n"
                           "Data/ShapeNetP2M/03001627/a/rendering/01.dat\n"
                           "Data/ShapeNetP2M/03001627/b/rendering/00.dat\n");
  const Path test = Write("test_list.txt", "Data/ShapeNetP2M/03001627/b/rendering/04.dat\n");
  const SplitList list = Ok(SplitList::Read({test, train})).value();
  EXPECT_EQ(list.size(), 2u);
  ExpectSplit(list, "03001627", "a", Split::kTrain);
  ExpectSplit(list, "03001627", "b", Split::kTest);
}

TEST_F(SplitListTest, DibrListsPicturesByOneName) {
  const SplitList list = Read("test_list.txt", "/data/02691156_d0-a_f_12.png\n04256520_e_0.png\n");
  ExpectSplit(list, "02691156", "d0-a_f", Split::kTest);
  ExpectSplit(list, "04256520", "e", Split::kTest);
}

// A list in a class's folder is of that class.
TEST_F(SplitListTest, NamesAlone) {
  const SplitList own = Read("03001627/softras_val.lst", "a\nb");
  ExpectSplit(own, "03001627", "b", Split::kValidation);
  ExpectSplit(own, "02958343", "b", std::nullopt);
  ExpectSplit(Read("train.lst", "a\n"), "02958343", "a", Split::kTrain);
}

TEST_F(SplitListTest, ShapeNetsTable) {
  const SplitList list = Read("all.csv",
                              "id,synsetId,subSynsetId,modelId,split\n"
                              "000001,02691156,02690373,a,train\n000002,02691156,2690373,b,val\n");
  ExpectSplit(list, "02691156", "a", Split::kTrain);
  ExpectSplit(list, "02691156", "b", Split::kValidation);
}

TEST_F(SplitListTest, JsonOfViewsAndOfNames) {
  const SplitList list = Read("splits.json", R"({"train": {"03001627": {"a": [0, 1]}},
                                                 "test": {"03001627": ["b"]}})");
  ExpectSplit(list, "03001627", "a", Split::kTrain);
  ExpectSplit(list, "03001627", "b", Split::kTest);
}

// 3D-R2N2's shapenet_1000.json: which classes, and no split.
TEST_F(SplitListTest, JsonOfClasses) {
  const SplitList list = Read("shapenet_1000.json", R"({"03001627": {"id": "03001627"}})");
  EXPECT_TRUE(list.Of("03001627", "a").used);
  EXPECT_FALSE(list.Of("03001627", "a").split);
  EXPECT_FALSE(list.Of("02958343", "a").used);
}

TEST_F(SplitListTest, WhatSaysNoSplitIsAnError) {
  const auto read = [&](const std::string& name, const std::string& text) {
    return SplitList::Read({Write(name, text)}).status();
  };
  ExpectMessage(read("models.txt", "03001627/a\n"), "models.txt: line 1");
  ExpectMessage(read("train_test.txt", "03001627/a\n"), "line 1");
  ExpectMessage(read("train.txt", "03001627/a exam\n"), "line 1");
  ExpectMessage(read("train.txt", "\n"), "lists no models");
  ExpectMessage(read("a.json", R"({"exam": {}})"), "exam");
  ExpectMessage(read("a.json", "{"), "a.json");
  ExpectMessage(SplitList::Read({folder_ / "none"}).status(), "none");
}

}  // namespace tilegrad::train::split_list_test
