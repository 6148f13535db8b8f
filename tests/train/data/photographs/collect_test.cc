// SPDX-License-Identifier: Apache-2.0
// CUB-200 and PASCAL3D+ in the layouts in which they are published: collected, trained on for a few
// steps, evaluated. Their cameras see the shapes where the sets' masks are.
#include "train/data/photographs/collect.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/miniature.h"
#include "train/data/photographs/pascal3d_miniature.h"
#include "train/tiny_run_fixture.h"

namespace tilegrad::train::collect_test {

double Iou(const PhotoMask& a, const PhotoMask& b) {
  int both = 0, either = 0;
  for (std::size_t i = 0; i < a.inside.size(); ++i) {
    both += a.inside[i] && b.inside[i];
    either += a.inside[i] || b.inside[i];
  }
  return static_cast<double>(both) / std::max(either, 1);
}

class CollectTest : public TinyRunTest {
 protected:
  Result<CollectionSummary> Collect(const CollectionJob& job, const std::string& out,
                                    int workers = 2) const {
    return CollectPhotographs(job, folder_ / out, Workers(workers), {});
  }

  // Twenty steps, and the scores of the test part.
  void ExpectTrains(const std::string& data) const {
    const std::string run = data + "_run";
    Ok(Train({.run = run,
              .config = kTinyPhotographs,
              .settings = {"schedule.steps=20"},
              .data = data})
           .status());
    EXPECT_LT(*Ok(Evaluate(run, data))->rows[0].mean.mask_loss, 0.95);
  }

  // The first half of a file.
  static void CutFile(const Path& file) {
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  }
};

TEST_F(CollectTest, ReadsPascal3dByItsOwnAnnotations) {
  const Pascal3dMiniature set(folder_ / "p3d", 12, 4);
  const auto made = Ok(Collect({"pascal3d", folder_ / "p3d"}, "cars"));
  EXPECT_EQ(made->photographs, (std::array<int, 3>{13, 0, 5}));
  EXPECT_EQ(made->broken.Summary(), "");
  EXPECT_EQ(made->notes.at("objects truncated, occluded or difficult"), 2);
  EXPECT_EQ(made->notes.at("objects of PASCAL VOC"), 2);
  EXPECT_EQ(made->notes.at("objects drawn from CAD models"), 16);
  const auto read = Ok(OpenPhotographs(folder_ / "cars"));
  EXPECT_EQ(read->keypoint_names.size(), 12u);
  EXPECT_EQ(read->keypoint_names[0], "left_back_bumper");
  EXPECT_EQ(read->mirror[0], 6);

  // The mean keypoints are the shape's, in our axes, at another scale.
  const auto found = [&](const std::string& name) {
    return read->mean_keypoints[static_cast<std::size_t>(
        std::ranges::find(read->keypoint_names, name) - read->keypoint_names.begin())];
  };
  const auto left = found("left_front_bumper"), right = found("right_front_bumper");
  const double factor = (left[0] - right[0]) / (set.anchors()[0][0] - set.anchors()[1][0]);
  EXPECT_GT(factor, 0);
  EXPECT_NEAR(left[1], factor * set.anchors()[0][2], 0.02);
  EXPECT_NEAR(left[2], factor * -set.anchors()[0][1], 0.02);

  for (const Photograph& photo : read->photographs) {
    EXPECT_TRUE(std::filesystem::exists(photo.image));
    const PhotoMask& truth = set.masks().at({photo.id, 1});
    EXPECT_GE(Iou(photo.mask, truth), 0.98) << photo.id;
    std::vector<std::array<double, 2>> seen;
    for (const glm::vec3& p : set.mesh().positions) {
      const auto at = ProjectWeakly(*photo.camera, {factor * p.x, factor * p.y, factor * p.z});
      seen.push_back({at[0], at[1]});
    }
    const PhotoMask drawn = Filled(set.mesh(), seen, truth.width, truth.height);
    if (!photo.id.starts_with("car_imagenet")) continue;  // of the others a part is hidden
    EXPECT_GE(Iou(drawn, truth), 0.98) << photo.id;
  }
  ExpectTrains("cars");
}

TEST_F(CollectTest, IsTheSameForAnyWorkersAndKeepsPictures) {
  const Pascal3dMiniature set(folder_ / "p3d", 9, 2);
  ASSERT_TRUE(Collect({"pascal3d", folder_ / "p3d"}, "one", 1).ok());
  ASSERT_TRUE(Collect({"pascal3d", folder_ / "p3d"}, "two", 2).ok());
  EXPECT_EQ(Contents(folder_ / "one"), Contents(folder_ / "two"));
  const Path picture = folder_ / "one/Images/car_imagenet/n02814533_100.JPEG";
  const auto before = std::filesystem::last_write_time(picture);
  ASSERT_TRUE(Collect({"pascal3d", folder_ / "p3d"}, "one", 1).ok());
  EXPECT_EQ(std::filesystem::last_write_time(picture), before);
}

TEST_F(CollectTest, BrokenMembersOfPascal3dCostThemselves) {
  const Pascal3dMiniature set(folder_ / "p3d", 12, 4);
  const Path images = set.root() / "Images/car_imagenet";
  CutFile(images / "n02814533_101.JPEG");
  std::filesystem::remove(images / "n02814533_103.JPEG");
  CutFile(set.root() / "Annotations/car_imagenet/n02814533_105.mat");
  CollectionJob job{"pascal3d", folder_ / "p3d"};
  ExpectMessage(Collect(job, "cars").status(), "3 of 20", "--allow-broken", "n02814533_101.mat");
  job.allow_broken = true;
  const auto made = Ok(Collect(job, "cars"));
  EXPECT_EQ(made->photographs[0], 10);
  const std::string summary = made->broken.Summary();
  ExpectIn(summary, "_101.mat", "_103.mat", "_105.mat");
  ExpectTrains("cars");
  job.class_name = "boat";
  ExpectMessage(Collect(job, "boats").status(), "no usable photograph of class boat");
}

// The first CAD model is nobody's; the second is everybody's.
TEST_F(CollectTest, BrokenCadModelsOfPascal3dCostThemselves) {
  const Pascal3dMiniature set(folder_ / "p3d", 12, 4);
  const Path file = set.root() / "CAD/car.mat";
  io::MatVariables cad = io::LoadMat(file).value().variables;
  std::vector<io::MatArray>& fields = cad[0].second.elements;  // vertices, faces, ...
  CollectionJob job{"pascal3d", folder_ / "p3d"};
  const auto expect_one_broken = [&](const std::string& reason) {
    ASSERT_TRUE(io::SaveMat(file, cad).ok());
    ExpectMessage(Collect(job, "cars").status(), "1 of 20", "CAD/car.mat(1)", reason);
  };
  const io::MatArray whole = fields[1];
  fields[1] = io::MatArray::Numbers({0, 3}, {});
  expect_one_broken("no triangles");
  fields[1] = io::MatArray::Numbers({1, 3}, std::vector<double>{1, 2, 1e300});
  expect_one_broken("beyond its 3 vertices");
  fields[1] = whole;
  fields[0] = io::MatArray::Numbers({3, 3}, std::vector<double>(9, NAN));
  expect_one_broken("not finite");
  job.allow_broken = true;
  const auto made = Ok(Collect(job, "cars"));
  EXPECT_EQ(made->photographs, (std::array<int, 3>{13, 0, 5}));
  fields[2] = fields[0];
  ASSERT_TRUE(io::SaveMat(file, cad).ok());
  const auto masked = Collect(job, "cars");  // by PASCAL VOC alone
  ASSERT_TRUE(masked.ok()) << masked.status().message();
  EXPECT_EQ(masked->notes.at("objects without a mask"), 16);
}

TEST_F(CollectTest, TakesMasksOfAFolder) {
  const Pascal3dMiniature set(folder_ / "p3d", 9, 2);
  ImageU8 mask(Pascal3dMiniature::kWidth, Pascal3dMiniature::kHeight, 1, 0);
  for (int y = 20; y < 50; ++y) std::fill_n(mask.at(30, y), 40, std::uint8_t{255});
  ASSERT_TRUE(io::SavePng(folder_ / "masks/car_imagenet/n02814533_104.png", mask).ok());
  CollectionJob job{"pascal3d", folder_ / "p3d"};
  job.masks = folder_ / "masks";
  const auto made = Ok(Collect(job, "cars"));
  EXPECT_EQ(made->notes.at("objects of the masks folder"), 1);
  const auto read = Ok(OpenPhotographs(folder_ / "cars"));
  EXPECT_TRUE(read->photographs[4].mask.at(30, 20));
  EXPECT_FALSE(read->photographs[4].mask.at(29, 20));
  EXPECT_EQ(std::ranges::count(read->photographs[4].mask.inside, true), 30 * 40);
}

// CUB-200: the bars of the miniature are dots at the keypoints.
TEST_F(CollectTest, BrokenPicturesOfCubCostThemselves) {
  const PhotographSet set = WriteMiniature(folder_ / "cub", "cub", {.train = 12, .test = 4});
  CutFile(set.photographs[1].image);
  std::filesystem::remove(set.photographs[3].image);
  CollectionJob job{"cub", folder_ / "cub"};
  ExpectMessage(Collect(job, "birds").status(), "2 of 16", "bar_1.png");
  job.allow_broken = true;
  const auto made = Ok(Collect(job, "birds"));
  EXPECT_EQ(made->photographs, (std::array<int, 3>{10, 0, 4}));
  const std::string summary = made->broken.Summary();
  ExpectIn(summary, "bar_1.png", "bar_3.png");
  const auto read = Ok(OpenPhotographs(folder_ / "birds"));
  for (const Photograph& photo : read->photographs) {
    PhotoMask drawn = photo.mask;
    for (std::size_t i = 0; i < drawn.inside.size(); ++i) {
      const double x = static_cast<double>(i % 60) + 0.5, y = static_cast<double>(i / 60) + 0.5;
      drawn.inside[i] = std::ranges::any_of(read->mean_keypoints, [&](const auto& place) {
        const auto at = ProjectWeakly(*photo.camera, place);
        return std::hypot(x - at[0], y - at[1]) <= 4;
      });
    }
    EXPECT_GE(Iou(drawn, photo.mask), 0.98) << photo.id;
  }
  ExpectTrains("birds");
  // An annotation that makes no sense.
  const Path annotations = folder_ / "cub/cachedir/cub/data/test_cub_cleaned.mat";
  io::MatVariables images = io::LoadMat(annotations).value().variables;
  std::vector<io::MatArray>& fields = images[0].second.elements;
  const auto mask = std::ranges::find(images[0].second.fields, "mask");
  ASSERT_NE(mask, images[0].second.fields.end());
  fields[static_cast<std::size_t>(mask - images[0].second.fields.begin())] =
      io::MatArray::Mask(2, 2, {0, 0, 0, 0});
  ASSERT_TRUE(io::SaveMat(annotations, images).ok());
  job.allow_broken = false;
  ExpectMessage(Collect(job, "birds").status(), "3 of 16", "test_cub_cleaned.mat(1)", "empty");
  ExpectMessage(OpenPhotographs(folder_ / "cub").status(), "the mask is empty");
  ExpectMessage(Collect({"cub", folder_}, "none").status(), "train_cub_cleaned.mat");
}

}  // namespace tilegrad::train::collect_test
