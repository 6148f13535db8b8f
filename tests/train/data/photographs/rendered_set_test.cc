// SPDX-License-Identifier: Apache-2.0
// Photographs that anyone can make: a few of boxes.
#include "train/data/photographs/rendered_set.h"

#include <gtest/gtest.h>

#include "io/image_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"
#include "train/data/photographs/factorization.h"

namespace tilegrad::train::rendered_set_test {

class RenderedSet : public TempFolderTest {
 protected:
  RenderedSet() {
    ImageU8 sky(300, 200, 3, 90);
    EXPECT_TRUE(io::SavePng(folder_ / "sky.png", sky).ok());
  }
  Status Make(const std::string& out, int workers, const AnnotationNoise& noise = {}) {
    const RenderedSetJob job{models_, models_, {folder_ / "sky.png"}, 18, 4};
    return MakeRenderedSet(job, noise, folder_ / out, Workers(workers), {});
  }
  static Result<TexturedMesh> RedBox(std::size_t) {
    Mesh box = Box(glm::vec3(0), {0.4f, 0.3f, 0.9f});
    SetColor(box, {0.8f, 0.3f, 0.2f, 1});
    return TexturedMesh(std::move(box));
  }
  MeshCache models_{1, 1 << 30, RedBox};
};

TEST_F(RenderedSet, IsInTheLayoutOfPascal3d) {
  ASSERT_TRUE(Make("a", 2, {.mask = 0, .keypoint = 0, .hidden = 0}).ok());
  const auto set = Ok(OpenPhotographs(folder_ / "a"));
  EXPECT_EQ(set->source, "pascal3d");
  EXPECT_GT(set->Select(Split::kTrain).size(), 10u);
  EXPECT_GT(set->Select(Split::kTest).size(), 1u);
  for (const Photograph& photo : set->photographs) {
    EXPECT_TRUE(std::filesystem::exists(photo.image));
    for (const Keypoint& k : photo.keypoints) {
      if (!k.visible) continue;
      EXPECT_GT(k.x, photo.box.left - 2);
      EXPECT_LT(k.x, photo.box.right + 2);
    }
  }
}

// The test part's cameras see the true keypoints where they are annotated, but for perspective: an
// eighth of a box at most, as objects are about a unit deep and 2.3 units away; the training part's
// know a mean shape only. Nothing tells where the training part's keypoints truly are.
TEST_F(RenderedSet, TestCamerasAreExact) {
  ASSERT_TRUE(Make("a", 2).ok());
  const auto set = Ok(OpenPhotographs(folder_ / "a"));
  double sum = 0;
  int count = 0;
  for (const Photograph& photo : set->photographs) {
    EXPECT_EQ(photo.points.empty(), photo.split == Split::kTrain);
    if (photo.points.empty()) continue;
    ASSERT_EQ(photo.points.size(), photo.keypoints.size());
    sum += WeakCameraError(photo.points, photo.keypoints, *photo.camera) / photo.box.longer_side();
    ++count;
  }
  ASSERT_GT(count, 1);
  EXPECT_LT(sum / count, 0.04);
}

// The training part's, on demand: all objects are stretched boxes here, so that keypoints of the
// mean shape are near those of each.
TEST_F(RenderedSet, TrainingCamerasAreExactIfWished) {
  const auto error = [&](const std::string& name, bool exact) {
    EXPECT_TRUE(Make(name, 2, {.exact_cameras = exact}).ok());
    const auto set = Ok(OpenPhotographs(folder_ / name));
    double sum = 0;
    for (const int i : set->Select(Split::kTrain)) {
      const Photograph& photo = set->photographs[static_cast<std::size_t>(i)];
      EXPECT_TRUE(photo.points.empty());
      sum += WeakCameraError(set->mean_keypoints, photo.keypoints, *photo.camera) /
             photo.box.longer_side();
    }
    return sum / static_cast<double>(set->Select(Split::kTrain).size());
  };
  const double found = error("found", false), exact = error("exact", true);
  EXPECT_LT(exact, 0.08);
  EXPECT_NE(exact, found);
}

TEST_F(RenderedSet, IsTheSameForAnyWorkers) {
  ASSERT_TRUE(Make("one", 1).ok());
  ASSERT_TRUE(Make("two", 2).ok());
  for (const char* file :
       {"data/car_train.mat", "sfm/car_val.mat", "Images/car_rendered/train_00003.png"})
    EXPECT_EQ(ReadFile(folder_ / "one" / file).value(), ReadFile(folder_ / "two" / file).value())
        << file;
}

TEST_F(RenderedSet, NeedsModelsAndBackgrounds) {
  const MeshCache none(0, 1, RedBox);
  const RenderedSetJob job{none, models_, {folder_ / "sky.png"}};
  ExpectMessage(MakeRenderedSet(job, {}, folder_ / "b", Workers(1), {}), "models");
  const RenderedSetJob bare{models_, models_, {}};
  ExpectMessage(MakeRenderedSet(bare, {}, folder_ / "c", Workers(1), {}), "background");
}

TEST(ExtremePoints, OfABoxAreItsCorners) {
  const auto points = FindExtremePoints(Box({1, 2, 3}, {2, 4, 6}));
  const std::vector<int> mirror = ExtremeMirror();
  for (std::size_t k = 0; k < points.size(); ++k) {
    const glm::vec3 p = points[k] - glm::vec3(1, 2, 3);
    EXPECT_NEAR(std::abs(p.x), 1, 1e-5);
    EXPECT_GT(p.x * kExtremePoints[k].direction[0], 0);
    const glm::vec3 m = points[static_cast<std::size_t>(mirror[k])] - glm::vec3(1, 2, 3);
    EXPECT_NEAR(p.x, -m.x, 1e-5);
    EXPECT_NEAR(p.z, m.z, 1e-5);
  }
  EXPECT_EQ(points[0], glm::vec3(2, 0, 6));  // left, low, in front
}

TEST(MaskNoise, MovesTheOutlineAndNothingElse) {
  PhotoMask mask{60, 40, std::vector<bool>(2400)};
  for (int y = 8; y < 32; ++y)
    for (int x = 10; x < 50; ++x) mask.inside[static_cast<std::size_t>(y * 60 + x)] = true;
  Rng rng(5);
  int changed = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const PhotoMask other = DisturbedMask(mask, 1.5, rng);
    EXPECT_TRUE(other.at(30, 20));
    EXPECT_FALSE(other.at(0, 0));
    for (std::size_t i = 0; i < 2400; ++i) changed += other.inside[i] != mask.inside[i];
  }
  EXPECT_GT(changed, 20 * 60);
  EXPECT_LT(changed, 20 * 500);
  EXPECT_EQ(DisturbedMask(mask, 0, rng).inside, mask.inside);
}

}  // namespace tilegrad::train::rendered_set_test
