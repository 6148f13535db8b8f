// SPDX-License-Identifier: Apache-2.0
// Fits that start from the hull of their masks.
#include <gtest/gtest.h>

#include <cmath>

#include "fit/views_fixture.h"

namespace tilegrad::train::hull_fit_test {

class HullFit : public ViewsTest {
 protected:
  FitJob Job(const std::string& out, const Mesh& mesh = Torus(0.3f, 0.12f, 24, 12), int size = 32) {
    FitJob job;
    job.input = Views(mesh, {.views = 8, .held_out = 2, .size = size});
    job.out = folder_ / out;
    job.config.start = StartShape::kHull;
    job.config.steps = 40;
    job.config.texture_size = 128;
    job.config.timelapse = 0;
    job.config.checkpoint_every = 20;
    return job;
  }
};

TEST_F(HullFit, StoppedAndResumedEndsInTheSameBitsForAnyWorkers) {
  for (const bool colors : {false, true}) {
    FitJob job = Job(colors ? "colors" : "texture");
    job.config.vertex_colors = colors;
    ExpectSameInParts(job, {5, 16, 20, 29});
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
  ExpectIn(sphere->note, "no hull: a texture of 8 x 8");
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
  Ok(Run(job).status());
  const auto mesh = Ok(io::LoadMesh(job.out / "mesh.glb"));
  for (const glm::vec3& p : mesh->mesh.positions) EXPECT_GT(std::hypot(p.x, p.z), 0.02f);
}

}  // namespace tilegrad::train::hull_fit_test
