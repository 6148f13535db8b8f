// SPDX-License-Identifier: Apache-2.0
// Fits that start from the hull of their masks.
#include <gtest/gtest.h>

#include <cmath>

#include "fit/make_views.h"
#include "fit/run.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::train::hull_fit_test {

class HullFit : public TempFolderTest {
 protected:
  FitJob Job(const std::string& out, const Mesh& mesh = Torus(0.3f, 0.12f, 24, 12), int size = 32) {
    Ok(MakeViews(mesh, {.views = 8, .held_out = 2, .size = size}, folder_ / "views",
                 OutputGuard(true), {}, stop_));
    FitJob job;
    job.input = ReadFitFolder(folder_ / "views", 0).value();
    job.out = folder_ / out;
    job.config.start = StartShape::kHull;
    job.config.steps = 40;
    job.config.texture_size = 128;
    job.config.timelapse = 0;
    job.config.checkpoint_every = 20;
    return job;
  }
  Bytes Read(const std::string& out) { return ReadFile(folder_ / out / "mesh.glb").value(); }
  StopFlag stop_ = false;
};

TEST_F(HullFit, StoppedAndResumedEndsInTheSameBitsForAnyWorkers) {
  for (const bool colors : {false, true}) {
    const std::string whole = colors ? "whole_colors" : "whole", parts = whole + "_parts";
    FitJob job = Job(whole);
    job.config.vertex_colors = colors;
    ASSERT_TRUE(RunFit(job, Workers(1), {}, stop_).ok());
    job.out = folder_ / parts;
    for (const std::uint64_t stop_at : {5u, 16u, 20u, 29u}) {
      const auto stop = [&](const Progress& p) {
        stop_ = p.stage == "fitting" && p.done == stop_at;
      };
      const auto stopped = RunFit(job, Workers(2), stop, stop_);
      ASSERT_EQ(stopped.status().code(), StatusCode::kCancelled) << stopped.status().message();
      stop_ = false;
      job.existing = ExistingRun::kContinue;
    }
    const auto resumed = Ok(RunFit(job, Workers(7), {}, stop_));
    EXPECT_EQ(resumed->first_step, 29);
    EXPECT_EQ(Read(whole), Read(parts));
  }
}

// A hull whose charts have no room in the texture gets a larger one; where four times the side is
// not enough, a fit that need not start from the hull says why it starts from a sphere.
TEST_F(HullFit, ChartsWithoutRoomGetALargerTexture) {
  FitJob job = Job("run");
  job.config.texture_size = 16;
  const auto larger = Ok(PrepareFit(job, Workers(1)));
  EXPECT_GT(larger->scene.texture.width, 16);
  EXPECT_LE(larger->scene.texture.width, 64);
  job.config.texture_size = 2;
  job.config.start = StartShape::kAuto;
  const auto sphere = Ok(PrepareFit(job, Workers(1)));
  EXPECT_NE(sphere->note.find("no hull: a texture of 8 x 8"), std::string::npos) << sphere->note;
}

// The ring is 3 pixels thick, the box 14.
TEST_F(HullFit, TheAreaPullsThinHullsLess) {
  const auto area = [](const FitJob& job) {
    const auto start = Ok(PrepareFit(job, Workers(1)));
    return start->config.regularizers.area;
  };
  const Mesh box = Box({0, 0, 0}, {0.9f, 0.6f, 0.7f});
  EXPECT_EQ(area(Job("thin")), 0.05);
  EXPECT_EQ(area(Job("thick", box, 64)), 0.3);
  FitJob given = Job("given");
  given.config.regularizers.area = 0.2;
  EXPECT_EQ(area(given), 0.2);
}

// What a sphere cannot: the hole of a ring.
TEST_F(HullFit, KeepsTheHole) {
  FitJob job = Job("ring");
  ASSERT_TRUE(RunFit(job, Workers(2), {}, stop_).ok());
  const auto mesh = Ok(io::LoadMesh(job.out / "mesh.glb"));
  for (const glm::vec3& p : mesh->mesh.positions) EXPECT_GT(std::hypot(p.x, p.z), 0.02f);
}

}  // namespace tilegrad::train::hull_fit_test
