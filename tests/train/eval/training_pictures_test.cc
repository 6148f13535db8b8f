// SPDX-License-Identifier: Apache-2.0
// What is unlike a run's training pictures, on ellipses of which everything is known.
#include "train/eval/training_pictures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "support/temp_folder.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train::training_pictures_test {

constexpr int kSize = 32, kViews = 2;

// A filled ellipse, straight alpha.
struct Ellipse {
  double x = 16, y = 16, a = 10, b = 10;  // centre and half-axes, pixels
  std::uint8_t grey = 128;
};
ImageU8 Draw(const Ellipse& e, int size = kSize) {
  ImageU8 out(size, size, 4);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const double u = (x + 0.5 - e.x) / e.a, v = (y + 0.5 - e.y) / e.b;
      if (u * u + v * v > 1) continue;
      std::fill_n(out.at(x, y), 3, e.grey);
      out.at(x, y)[3] = 255;
    }
  }
  return out;
}

// Thin stripes, as of letters.
ImageU8 Stripes() {
  ImageU8 out(64, 64, 4);
  for (int y = 4; y < 60; y += 14) {
    for (int x = 4; x < 60; ++x)
      for (int c = 0; c < 4; ++c) out.at(x, y)[c] = c == 3 ? 255 : 20;
  }
  return out;
}

// Of model m: ellipses that are 9 + m and 10 + m pixels wide in its two views, as grey as 100 + 3
// m.
Ellipse Shown(int m, int view) {
  return {.a = (9.0 + m + view) / 2, .b = 10, .grey = static_cast<std::uint8_t>(100 + 3 * m)};
}

class TrainingPicturesTest : public TempFolderTest {
 protected:
  // `shape`: what the models' shapes are called; "": each is its own.
  TrainingPictures Make(int models, const std::string& shape = "", int workers = 1) {
    DatasetInfo info;
    info.source = "nmr";
    info.classes = {"ellipse"};
    info.recipe = "0000000000000000";
    info.image_size = info.camera.lens.width = info.camera.lens.height = kSize;
    info.views = kViews;
    ImageStore store;
    store.models = models;
    store.views = kViews;
    store.size = kSize;
    Bytes bytes;
    std::vector<ModelInfo> infos;
    for (int m = 0; m < models; ++m) {
      ModelInfo& model = infos.emplace_back();
      model.id = "m" + std::to_string(m);
      model.name = "a\tb " + model.id;
      model.shape = shape;
      for (int v = 0; v < kViews; ++v)
        AddPlanar(picture_.empty() ? Draw(Shown(m, v)) : picture_, &bytes);
    }
    store.bytes.Assign(bytes);
    EXPECT_TRUE(WriteDatasetInfo(folder_, info).ok());
    EXPECT_TRUE(WriteModels(folder_, info, infos).ok());
    return TrainingPictures::Of(Dataset::Open(folder_).value(), store, Workers(workers));
  }
  static void AddPlanar(const ImageU8& image, std::vector<std::uint8_t>* bytes) {
    for (std::size_t c = 0; c < 4; ++c) {
      for (std::size_t p = 0; p < image.pixels.size() / 4; ++p)
        bytes->push_back(image.pixels[4 * p + c]);
    }
  }
  static TrainingPictures::Match Nearest(const TrainingPictures& pictures, const ImageU8& image) {
    const auto match = pictures.Nearest(image);
    EXPECT_TRUE(match.ok() && *match);
    return match.ok() && *match ? **match : TrainingPictures::Match{};
  }

  ImageU8 picture_;  // of all models and views, if not empty
};

TEST_F(TrainingPicturesTest, FindsTheModelAndSaysHowFarItIs) {
  const TrainingPictures pictures = Make(8);
  EXPECT_EQ(pictures.count(), 16);
  const auto same = Nearest(pictures, Draw(Shown(3, 1)));
  EXPECT_EQ(same.name, "a b m3");  // one line, no tab
  EXPECT_EQ(same.class_name, "ellipse");
  EXPECT_EQ(same.distance, 0);
  // White instead of grey 100, where both cover: 155 / 255 of colour, none of coverage.
  const auto other = Nearest(Make(1), Draw({.a = Shown(0, 0).a, .b = 10, .grey = 255}));
  EXPECT_NEAR(other.distance, 155 / 255.0 / std::sqrt(2), 0.04);  // the edge's pixels are mixed
}

TEST_F(TrainingPicturesTest, PlaceAndSizeInThePictureDoNotCount) {
  const TrainingPictures pictures = Make(8);
  const Ellipse e = Shown(5, 0);
  const auto moved =
      Nearest(pictures, Draw({.x = 60, .y = 70, .a = 4 * e.a, .b = 4 * e.b, .grey = e.grey}, 128));
  EXPECT_LT(moved.distance, 0.1);  // of the edge's pixels
  EXPECT_FALSE(pictures.IsUnlike(moved));
}

TEST_F(TrainingPicturesTest, WarnsOfWhatIsFurtherThanTheyAreFromEachOther) {
  const TrainingPictures pictures = Make(8);
  ASSERT_TRUE(pictures.usual());
  EXPECT_GT(*pictures.usual(), 0);
  Ellipse between = Shown(3, 0);
  between.grey = 111;
  EXPECT_FALSE(pictures.IsUnlike(Nearest(pictures, Draw(between))));
  EXPECT_TRUE(pictures.IsUnlike(Nearest(pictures, Stripes())));
  EXPECT_FALSE(pictures.IsUnlike({"", "", *pictures.usual()}));
  EXPECT_TRUE(pictures.IsUnlike({"", "", 1.001 * *pictures.usual()}));
}

// Copies of one shape say nothing of how far another shape may be.
TEST_F(TrainingPicturesTest, WithoutASecondShapeNothingIsUnlike) {
  for (const TrainingPictures& pictures : {Make(1), Make(4, "one")}) {
    EXPECT_FALSE(pictures.usual());
    EXPECT_FALSE(pictures.IsUnlike(Nearest(pictures, Stripes())));
  }
}

TEST_F(TrainingPicturesTest, WhatCannotBeFramedIsLeftOut) {
  const ImageU8 opaque(kSize, kSize, 4, 255);
  EXPECT_FALSE(Make(2).Nearest(opaque).ok());  // of an input it is an error
  picture_ = opaque;
  const TrainingPictures none = Make(2);
  EXPECT_EQ(none.count(), 4);
  const auto match = Ok(none.Nearest(Stripes()));
  EXPECT_FALSE(*match);
}

TEST_F(TrainingPicturesTest, ReadsWhatItWrote) {
  const TrainingPictures made = Make(8);
  ASSERT_TRUE(made.Write(folder_ / "run").ok());
  const Bytes bytes = ReadFile(folder_ / "run/thumbnails.npz").value();
  ASSERT_TRUE(Make(8, "", 3).Write(folder_ / "run").ok());
  EXPECT_EQ(ReadFile(folder_ / "run/thumbnails.npz").value(), bytes);
  const Path checkpoint = Write("run/checkpoints/step_00000001.safetensors", std::string("x"));
  for (const Path& path : {folder_ / "run", checkpoint}) {
    const auto read = TrainingPictures::Read(path);
    ASSERT_TRUE(read.ok() && *read) << read.status().message();
    EXPECT_EQ((*read)->count(), 16);
    EXPECT_EQ((*read)->usual(), made.usual());
    EXPECT_EQ(Nearest(**read, Stripes()).distance, Nearest(made, Stripes()).distance);
    EXPECT_EQ(Nearest(**read, Draw(Shown(6, 0))).name, "a b m6");
  }
}

TEST_F(TrainingPicturesTest, RunsOfEarlierVersionsHaveNoneAndBrokenOnesAreErrors) {
  const auto none = Ok(TrainingPictures::Read(folder_ / "old"));
  EXPECT_FALSE(*none);
  ASSERT_TRUE(Make(8).Write(folder_ / "run").ok());
  const Bytes whole = ReadFile(folder_ / "run/thumbnails.npz").value();
  for (const std::size_t size : {std::size_t{0}, std::size_t{100}, whole.size() / 2}) {
    Write("run/thumbnails.npz", Bytes(whole.begin(), whole.begin() + static_cast<long>(size)));
    ExpectMessage(TrainingPictures::Read(folder_ / "run").status(), "thumbnails.npz");
  }
}

}  // namespace tilegrad::train::training_pictures_test
