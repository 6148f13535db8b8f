// SPDX-License-Identifier: Apache-2.0
// Photographs in the three layouts, and the crops that networks see of them.
#include "train/data/photographs/photographs.h"

#include <gtest/gtest.h>

#include "io/mat_file.h"
#include "support/temp_folder.h"
#include "train/data/photographs/miniature.h"
#include "train/data/photographs/photo_store.h"

namespace tilegrad::train::photographs_test {

class PhotographsTest : public TempFolderTest {
 protected:
  Workers workers_{2};
};

void ExpectSame(const PhotographSet& want, const PhotographSet& got) {
  ASSERT_EQ(got.photographs.size(), want.photographs.size());
  EXPECT_EQ(got.mirror, want.mirror);
  EXPECT_EQ(got.keypoint_names, want.keypoint_names);
  for (std::size_t i = 0; i < got.photographs.size(); ++i) {
    const Photograph &a = want.photographs[i], &b = got.photographs[i];
    EXPECT_EQ(a.image, b.image);
    EXPECT_EQ(a.split, b.split);
    EXPECT_EQ(a.mask.inside, b.mask.inside);
    EXPECT_EQ(a.box.left, b.box.left);
    EXPECT_EQ(a.box.bottom, b.box.bottom);
    for (std::size_t k = 0; k < a.keypoints.size(); ++k) {
      EXPECT_EQ(a.keypoints[k].visible, b.keypoints[k].visible);
      if (!a.keypoints[k].visible) continue;
      EXPECT_NEAR(a.keypoints[k].x, b.keypoints[k].x, 1e-12);
    }
    EXPECT_NEAR(a.camera->translation[1], b.camera->translation[1], 1e-12);
    const auto p = want.mean_keypoints[3];
    EXPECT_NEAR(ProjectWeakly(*a.camera, p)[0], ProjectWeakly(*b.camera, p)[0], 1e-9);
  }
}

TEST_F(PhotographsTest, ReadsCubAndPascal3d) {
  for (const char* source : {"cub", "pascal3d"}) {
    const PhotographSet want = WriteMiniature(folder_ / source, source);
    const auto got = Ok(OpenPhotographs(folder_ / source));
    EXPECT_EQ(got->source, source);
    ExpectSame(want, *got);
    EXPECT_EQ(got->Select(Split::kTest).size(), 3u);
  }
}

// Numbers by hand, as MATLAB counts: from 1, and boxes include their last pixels.
TEST_F(PhotographsTest, PixelsCountFromOneInTheFiles) {
  PhotographSet set = WriteMiniature(folder_, "cub");
  auto file = Ok(io::LoadMat(folder_ / "cachedir/cub/data/train_cub_cleaned.mat"));
  io::MatArray& images = file->variables[0].second;
  images.elements[1] = io::MatArray::Structs({"x1", "y1", "x2", "y2"},
                                             {io::MatArray::Number(3), io::MatArray::Number(5),
                                              io::MatArray::Number(10), io::MatArray::Number(5)});
  std::vector<double> parts(45, 1.0);
  images.elements[4] = io::MatArray::Numbers({3, 15}, parts);
  Ok(io::SaveMat(folder_ / "cachedir/cub/data/train_cub_cleaned.mat", file->variables));
  const auto got = Ok(OpenPhotographs(folder_));
  const PhotoBox& box = got->photographs[0].box;
  EXPECT_EQ(box.left, 2);
  EXPECT_EQ(box.right, 10);
  EXPECT_EQ(box.top, 4);
  EXPECT_EQ(box.bottom, 5);
  EXPECT_EQ(got->photographs[0].keypoints[0].x, 0.5);  // the first pixel's centre
}

TEST_F(PhotographsTest, WhatDoesNotFitIsAnError) {
  ExpectMessage(OpenPhotographs(folder_ / "none").status(), "no such folder");
  ExpectMessage(OpenPhotographs(folder_).status(), "train_cub_cleaned.mat");
  const PhotographSet set = WriteMiniature(folder_, "cub");
  const Path data = folder_ / "cachedir/cub/data", sfm = folder_ / "cachedir/cub/sfm";
  const Bytes whole = ReadFile(data / "train_cub_cleaned.mat").value();
  std::filesystem::copy_file(data / "test_cub_cleaned.mat", data / "train_cub_cleaned.mat",
                             std::filesystem::copy_options::overwrite_existing);
  ExpectMessage(OpenPhotographs(folder_).status(), "has 3 pictures", "has 10 cameras");
  Write("cachedir/cub/data/train_cub_cleaned.mat", Bytes(whole.begin(), whole.end() - 9));
  ExpectMessage(OpenPhotographs(folder_).status(), "train_cub_cleaned.mat", "cut off");
  Write("cachedir/cub/data/train_cub_cleaned.mat", whole);
  std::filesystem::remove(sfm / "anno_train.mat");
  ExpectMessage(OpenPhotographs(folder_).status(), "anno_train.mat");
}

struct Change {
  const char* field;
  io::MatArray value;
  std::vector<std::string> parts;
};

// Of what WriteMiniature wrote, a field of the second picture or camera is replaced: the file that
// has it, and how opening it ends.
std::pair<Path, Status> OpenedWith(const Path& folder, const Change& change) {
  const bool camera =
      std::string(change.field) == "rot" || change.field[0] == 's' || change.field[0] == 't';
  const Path path = folder / (camera ? "cachedir/cub/sfm/anno_train.mat"
                                     : "cachedir/cub/data/train_cub_cleaned.mat");
  const Bytes before = ReadFile(path).value();
  auto file = io::LoadMat(path).value();
  io::MatArray& array = file.variables[0].second;
  const auto field = static_cast<std::size_t>(std::ranges::find(array.fields, change.field) -
                                              array.fields.begin());
  array.elements[array.fields.size() + field] = change.value;
  EXPECT_TRUE(io::SaveMat(path, file.variables).ok());
  const Status status = OpenPhotographs(folder).status();
  EXPECT_TRUE(WriteFileAtomic(path, before).ok());
  EXPECT_EQ(status.ok(), change.parts.empty()) << change.field << status.message();
  for (const std::string& part : change.parts) ExpectMessage(status, part);
  return {path, status};
}

TEST_F(PhotographsTest, ErrorsNameFileAndField) {
  WriteMiniature(folder_, "cub");
  const std::vector<double> nothing(45, NAN), shear = {1, 0, 0, 0.5, 1, 0, 0, 0, 1};
  const Change changes[] = {
      {"rel_path", io::MatArray::Text("../../etc/passwd"), {"images(2).rel_path", "is outside of"}},
      {"rel_path", io::MatArray::Number(1), {"images(2).rel_path", "expected text"}},
      {"parts", io::MatArray::Number(1), {"images(2).parts", "expected 3 x 15"}},
      {"parts", io::MatArray::Numbers({3, 15}, nothing), {}},  // not visible: fine
      {"mask", io::MatArray::Mask(2, 2, {0, 0, 0, 0}), {"images(2).mask", "empty"}},
      {"bbox", io::MatArray::Number(1), {"images(2).bbox", "expected a struct"}},
      {"rot", io::MatArray::Numbers({3, 3}, shear), {"sfm_anno(2).rot", "not a rotation"}},
      {"scale", io::MatArray::Number(-1), {"sfm_anno(2).scale", "-1"}},
      {"trans", io::MatArray::Number(1), {"sfm_anno(2).trans", "expected 2 numbers"}}};
  for (const Change& change : changes) {
    const auto [file, status] = OpenedWith(folder_, change);
    if (!status.ok()) ExpectMessage(status, file.filename().string());
  }
}

io::MatArray Box(double x1, double y1, double x2, double y2) {
  std::vector<io::MatArray> corners;
  for (const double corner : {x1, y1, x2, y2}) corners.push_back(io::MatArray::Number(corner));
  return io::MatArray::Structs({"x1", "y1", "x2", "y2"}, corners);
}

// Else a crop would take hours, and a training end many steps later with a loss of infinity.
TEST_F(PhotographsTest, WhatIsFarFromAnyPictureNamesThePhotograph) {
  WriteMiniature(folder_, "cub");
  const std::vector<double> far_away(45, 1e300), down = {1, -1e300};
  const Change changes[] = {
      {"scale", io::MatArray::Number(1e300), {"scale is 1e+300"}},
      {"scale", io::MatArray::Number(1e-300), {"scale is 1e-300"}},
      {"trans", io::MatArray::Numbers({1, 2}, down), {"translation of -1e+300"}},
      {"parts", io::MatArray::Numbers({3, 15}, far_away), {"keypoint 1 at (1e+300, 1e+300)"}},
      {"bbox", Box(1, 1, 1e9, 48), {"box (0, 0) to (1000000000, 48)", "60 x 48 pixels"}},
      {"bbox", Box(-1e5, 1, 60, 48), {"box (-100001, 0)"}},
      {"bbox", Box(-58, -58, 120, 108), {}}};  // cut off at the edges, with room to spare
  for (const Change& change : changes) {
    const Status status = OpenedWith(folder_, change).second;
    if (!status.ok()) ExpectMessage(status, "001.Bar/bar_1.png");
  }
}

TEST_F(PhotographsTest, PicturesAreReadWithTheirMasks) {
  PhotographSet set = WriteMiniature(folder_, "cub");
  std::filesystem::remove(set.photographs[1].image);
  ExpectMessage(PhotoStore::Load(set, {0, 1}, {}, 16, workers_, {}).status(), "bar_1.png",
                "dataset --source cub leaves out");
  set.photographs[0].mask = {3, 3, std::vector<bool>(9, true)};
  ExpectMessage(PhotoStore::Load(set, {0}, {}, 16, workers_, {}).status(), "60 x 48 pixels",
                "3 x 3");
}

// By hand: a box of 10 x 20 is padded to 11 x 22, made 22 x 22 about its middle (15, 30).
TEST(PhotoWindows, ArePaddedSquares) {
  const PhotoWindow w = WindowOf({10, 20, 20, 40}, {.padding = 0.05, .jitter = 0}, nullptr);
  EXPECT_DOUBLE_EQ(w.side, 22);
  EXPECT_DOUBLE_EQ(w.left, 15 - 11);
  EXPECT_DOUBLE_EQ(w.top, 30 - 11);
  Rng rng(1);
  for (int i = 0; i < 1000; ++i) {
    const PhotoWindow j = WindowOf({10, 20, 20, 40}, {.padding = 0.05, .jitter = 0.05}, &rng);
    EXPECT_GE(j.side, 22 - 2 - 1e-9);
    EXPECT_LE(j.side, 22 + 2 + 1e-9);
    EXPECT_NEAR(j.left + j.side / 2, 15, 0.5 + 1e-9);
    EXPECT_NEAR(j.top + j.side / 2, 30, 1 + 1e-9);
  }
}

// Whatever is done to a photograph, camera and keypoints go with its pixels: the mean shape is seen
// at the keypoints, and mirroring twice is nothing.
TEST_F(PhotographsTest, CamerasAndKeypointsGoWithTheCrop) {
  const PhotographSet set = WriteMiniature(folder_, "cub");
  const auto store = Ok(PhotoStore::Load(set, {0, 1, 2, 3}, {}, 32, workers_, {}));
  std::vector<float> rgb(3 * 32 * 32), mask(32 * 32);
  int mirrored = 0;
  for (int i = 0; i < 4; ++i) {
    for (std::uint64_t position = 0; position < 20; ++position) {
      const CropDraw draw{3, position, position > 0, 0.5};
      const CroppedPhoto cut = store->Cut(i, draw, rgb, mask);
      for (std::size_t k = 0; k < 15; ++k) {
        if (!cut.keypoints[k].visible) continue;
        const auto seen = ProjectWeakly(cut.camera, set.mean_keypoints[k]);
        EXPECT_NEAR(seen[0], cut.keypoints[k].x, 1e-9);
        EXPECT_NEAR(seen[1], cut.keypoints[k].y, 1e-9);
        // The object is there: its mask at the keypoint's pixel.
        const int x = static_cast<int>((seen[0] + 1) * 16),
                  y = static_cast<int>((seen[1] + 1) * 16);
        ASSERT_TRUE(x >= 0 && x < 32 && y >= 0 && y < 32);
        EXPECT_GT(mask[static_cast<std::size_t>(y * 32 + x)], 0.5f) << i << " " << position;
      }
      const double box = cut.to_box * 2 / 1.1;
      EXPECT_NEAR(box, 1, 0.12);
      mirrored += cut.camera.quaternion[3] * set.photographs[i].camera->quaternion[3] < 0;
    }
  }
  EXPECT_GT(mirrored, 20);
}

TEST_F(PhotographsTest, BeyondTheEdgeIsWhiteAndOutside) {
  PhotographSet set = WriteMiniature(folder_, "cub");
  set.photographs[0].box = {-30, -30, 90, 90};
  const auto store = Ok(PhotoStore::Load(set, {0}, {}, 24, workers_, {}));
  std::vector<float> rgb(3 * 24 * 24), mask(24 * 24);
  store->Cut(0, {}, rgb, mask);
  EXPECT_EQ(rgb[0], 1.0f);
  EXPECT_EQ(mask[0], 0.0f);
}

class PhotoFolderTest : public PhotographsTest {
 protected:
  // Pictures with alpha of the miniature, and its keypoints.
  void WritePictures(int count) {
    set_.mirror = {1, 0, 3, 2, 5, 4, 6, 7};
    set_.mean_keypoints = MiniatureShape(set_.mirror);
    std::string places;
    for (int i = 0; i < count; ++i) {
      const Photograph photo = MiniaturePhoto(set_, i, {});
      const ImageU8 rgb = MiniaturePicture(photo, i);
      ImageU8 rgba(60, 48, 4);
      for (int y = 0; y < 48; ++y) {
        for (int x = 0; x < 60; ++x) {
          std::copy_n(rgb.at(x, y), 3, rgba.at(x, y));
          rgba.at(x, y)[3] = photo.mask.at(x, y) ? 255 : 0;
        }
      }
      const std::string name = "p" + std::to_string(100 + i) + ".png";
      EXPECT_TRUE(io::SavePng(folder_ / name, rgba).ok());
      places += (i == 0 ? "\"" : ", \"") + name + "\": [";
      for (std::size_t k = 0; k < 8; ++k) {
        places += k == 0 ? "" : ", ";
        places += i % 3 == 0 && k == 7 ? "null"
                                       : "[" + std::to_string(photo.keypoints[k].x) + ", " +
                                             std::to_string(photo.keypoints[k].y) + "]";
      }
      places += "]";
      set_.photographs.push_back(photo);
    }
    Write("keypoints.json", kNames + std::string("\"photographs\": {") + places + "}}");
  }
  static constexpr const char* kNames =
      R"({"names": ["a", "b", "c", "d", "e", "f", "g", "h"],
          "mirror": [["a", "b"], ["c", "d"], ["e", "f"]], )";
  PhotographSet set_;
};

TEST_F(PhotoFolderTest, FindsCamerasFromKeypoints) {
  WritePictures(24);
  const auto got = Ok(OpenPhotographs(folder_));
  EXPECT_EQ(got->source, "photographs");
  EXPECT_EQ(got->Select(Split::kTest).size(), 4u);
  double worst = 0;
  for (const Photograph& photo : got->photographs) {
    for (std::size_t k = 0; k < 8; ++k) {
      if (!photo.keypoints[k].visible) continue;
      const auto seen = ProjectWeakly(*photo.camera, got->mean_keypoints[k]);
      worst = std::max(worst,
                       std::hypot(seen[0] - photo.keypoints[k].x, seen[1] - photo.keypoints[k].y));
    }
  }
  EXPECT_LT(worst, 1);  // pixel
}

// Cameras of pictures first, ..., last - 1 that look along -z from (0, 0, 4).
std::string Transforms(int first, int last) {
  std::string frames;
  for (int i = first; i < last; ++i)
    frames += std::string(i == first ? "" : ",") + R"({"file_path": "p)" + std::to_string(100 + i) +
              R"(.png", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]})";
  return R"({"fl_x": 80, "fl_y": 80, "cx": 30, "cy": 24, "w": 60, "h": 48, "frames": [)" + frames +
         "]}";
}

TEST_F(PhotoFolderTest, TakesCamerasOfTransforms) {
  WritePictures(12);
  Write("transforms.json", Transforms(0, 12));
  const auto got = Ok(OpenPhotographs(folder_));
  EXPECT_NEAR(got->photographs[3].camera->scale, 20, 1e-9);
  EXPECT_NEAR(got->photographs[3].camera->translation[0], 30, 1e-9);
  // The mean place of a keypoint, seen by a camera that looks along -z: its mean in the pictures.
  double mean = 0;
  for (const Photograph& photo : got->photographs) mean += photo.keypoints[0].x / 12;
  EXPECT_NEAR(20 * got->mean_keypoints[0][0] + 30, mean, 1e-3);
}

TEST_F(PhotoFolderTest, TransformsOfTwoSplitsSayWhatIsHeldOut) {
  WritePictures(12);
  Write("transforms_train.json", Transforms(0, 9));
  ExpectMessage(OpenPhotographs(folder_).status(), "p109.png", "no camera for it among the 9");
  Write("transforms_test.json", Transforms(9, 12));
  const auto got = Ok(OpenPhotographs(folder_));
  EXPECT_EQ(got->Select(Split::kTest), (std::vector<int>{9, 10, 11}));
  EXPECT_TRUE(got->photographs[11].camera);
}

TEST_F(PhotoFolderTest, WithoutKeypointsThereAreNoCameras) {
  WritePictures(6);
  std::filesystem::remove(folder_ / "keypoints.json");
  const auto got = Ok(OpenPhotographs(folder_));
  EXPECT_FALSE(got->photographs[0].camera);
  EXPECT_TRUE(got->mean_keypoints.empty());
}

TEST_F(PhotoFolderTest, BrokenKeypointsAreErrors) {
  WritePictures(6);
  const auto refused = [&](const std::string& text, const auto&... parts) {
    Write("keypoints.json", text);
    ExpectMessage(OpenPhotographs(folder_).status(), parts...);
  };
  const std::string good = ReadText(folder_ / "keypoints.json").value();
  refused(good, "keypoints.json", "at least 8 photographs");
  refused("{", "not a JSON object");
  refused("{}", "\"names\"");
  refused(std::string(kNames) + "\"photographs\": {\"p100.png\": [1]}}",
          "\"p100.png\" needs 8 keypoints");
  refused(R"({"names": ["a"], "mirror": [["a", "z"]]})", "\"z\" is not one of");
  refused(R"({"names": ["a", "b", "a"]})", "\"names\" has \"a\" twice");
  // No mirror images: their pairs would be a ring.
  refused(R"({"names": ["a", "b", "c"], "mirror": [["a", "b"], ["b", "c"]]})",
          "\"mirror\" has \"b\" or \"c\" twice");
  std::string far_away = good, word = good;
  refused(far_away.replace(good.find("null"), 4, "[1e300, 5]"), "keypoints.json", "1e+300",
          "pixels away");
  refused(word.replace(good.find("null"), 4, "\"hm\""), "\"hm\" is neither");
}

TEST_F(PhotoFolderTest, PicturesThatAreNotReadAreNamed) {
  WritePictures(12);
  Write("IMG_1.HEIC", std::string("x"));
  ExpectMessage(OpenPhotographs(folder_).status(), "1 picture not in PNG, JPEG or WebP: IMG_1.HEIC",
                "convert them");
}

TEST_F(PhotoFolderTest, PicturesNeedMasks) {
  std::filesystem::create_directories(folder_ / "masks");
  ASSERT_TRUE(io::SavePng(folder_ / "a.png", ImageU8(4, 4, 3, 99)).ok());
  ExpectMessage(OpenPhotographs(folder_).status(), "a.png: no alpha", "masks/a.png");
  ASSERT_TRUE(io::SavePng(folder_ / "masks/a.png", ImageU8(5, 4, 1, 255)).ok());
  ExpectMessage(OpenPhotographs(folder_).status(), "masks/a.png");
  ASSERT_TRUE(io::SavePng(folder_ / "masks/a.png", ImageU8(4, 4, 1, 255)).ok());
  EXPECT_TRUE(OpenPhotographs(folder_).ok());
}

}  // namespace tilegrad::train::photographs_test
