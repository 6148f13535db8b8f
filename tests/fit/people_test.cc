// SPDX-License-Identifier: Apache-2.0
// Folders after what people reported of other programs: a sphere of radius 0.5 at (0.1, -0.05,
// 0.2), ten views of 56 x 56 pixels. shared/cases/README.md says what is right for each.
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "fit/run.h"
#include "fit/sphere.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"

namespace tilegrad::train::people_test {

const glm::vec3 kCentre{0.1f, -0.05f, 0.2f};

class PeoplesFolders : public TempFolderTest {
 protected:
  void SetUp() override {
    if (!SharedFile("cases/second/fit_base")) GTEST_SKIP() << "no shared/cases/second";
  }
  static Result<FitInput> Read(const std::string& name, int hold_out = 0) {
    return ReadFitFolder(SharedFile("cases/second/" + name).value(), hold_out);
  }

  // Runs a short fit. The mean distance of its start's vertices from the sphere, in radii.
  double Error(const std::string& name) {
    const auto input = Read(name);
    EXPECT_TRUE(input.ok()) << input.status().message();
    if (!input.ok()) return 1;
    FitJob job;
    job.input = *input;
    job.out = folder_ / name;
    job.config.steps = 60;
    job.config.timelapse = 0;
    job.config.texture_size = 64;
    job.warn = [this](const std::string& warning) { told_ += warning; };
    const StopFlag stop = false;
    const auto done = RunFit(job, Workers(2), {}, stop);
    EXPECT_TRUE(done.ok()) << done.status().message();
    if (!done.ok()) return 1;
    iou_ = MeanIou(done->training);
    const auto start = PrepareFit(job, Workers(2));
    double sum = 0;
    const auto& p = start->scene.positions;
    for (std::size_t i = 0; i < p.size(); i += 3) {
      const float radius = glm::distance(glm::vec3(p[i], p[i + 1], p[i + 2]), kCentre);
      sum += std::abs(static_cast<double>(radius) - 0.5) / 0.5;
    }
    return 3 * sum / static_cast<double>(p.size());
  }

  double iou_ = 0;
  std::string told_;
};

TEST_F(PeoplesFolders, WithoutAnyFaultAreTheMeasure) {
  EXPECT_LT(Error("fit_base"), 0.1);
  EXPECT_GT(iou_, 0.95);
  EXPECT_EQ(told_, "");
}

TEST_F(PeoplesFolders, OnARailFollowFromParallax) {
  EXPECT_LT(Error("fit_parallel"), 0.5);
  EXPECT_GT(iou_, 0.94);  // seen from one side alone
}

TEST_F(PeoplesFolders, OfCroppedPicturesHaveACentreOfZero) {
  EXPECT_EQ(Read("fit_cx0")->cameras[0].cx, 0);
  EXPECT_LT(Error("fit_cx0"), 0.3);
}

TEST_F(PeoplesFolders, WithTwoModelsGiveTheLarger) {
  const auto input = Read("fit_two_models");
  EXPECT_EQ(input->cameras.size(), 10u);
  ASSERT_EQ(input->warnings.size(), 1u);
  EXPECT_NE(input->warnings[0].find("0 (4)"), std::string::npos) << input->warnings[0];
  EXPECT_LT(Error("fit_two_models"), 0.1);
}

TEST_F(PeoplesFolders, WithOneViewWithoutMaskAreRefused) {
  for (const char* name : {"fit_some_mask_paths", "fit_one_without_alpha"})
    ExpectMessage(Read(name).status(), name, ".png: has no mask");
}

TEST_F(PeoplesFolders, OfOtherFormatsAreReadOrNamed) {
  EXPECT_EQ(Read("fit_webp")->names.size(), 10u);
  const auto mixed = Read("fit_mixed_kinds");
  EXPECT_EQ(mixed->names.size(), 7u);
  ASSERT_EQ(mixed->warnings.size(), 1u);
  for (const char* name : {"007.heic", "008.tif", "009.bmp"})
    EXPECT_NE(mixed->warnings[0].find(name), std::string::npos);
}

TEST_F(PeoplesFolders, WithAnEmptyMaskGiveTheSphereOfTheOthers) {
  const auto input = Read("fit_empty_mask");
  EXPECT_EQ(input->names.size(), 9u);
  ASSERT_EQ(input->warnings.size(), 1u);
  EXPECT_NE(input->warnings[0].find("mask is empty"), std::string::npos);
  EXPECT_LT(Error("fit_empty_mask"), 0.1);
}

TEST_F(PeoplesFolders, OfViewsFromOneSideSayThatDepthIsNotKnown) {
  EXPECT_LT(Error("fit_narrow"), 0.3);
  EXPECT_NE(told_.find("depth"), std::string::npos) << told_;
}

}  // namespace tilegrad::train::people_test
