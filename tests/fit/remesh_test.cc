// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "fit/clock.h"
#include "fit/fitter.h"
#include "fit/make_views.h"
#include "fit/remesh_scene.h"
#include "fit/run.h"
#include "fit/transfer_texture.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "scene/unwrap.h"
#include "support/temp_folder.h"

namespace tilegrad::train::remesh_test {

// A sphere with charts and a texture whose colour says where on the sphere it is.
FitScene ColoredSphere(int level, float radius) {
  Mesh mesh = Icosphere(level, radius);
  EXPECT_TRUE(Unwrap({.width = 128, .height = 128}, &mesh).ok());
  FitScene scene = SceneOfMesh(mesh).value();
  scene.colors.clear();
  scene.texture = Image(128, 128, 3, 0.5f);
  return scene;
}

float ColorAt(const float* p, std::size_t c) { return 0.5f + p[c]; }

// The largest difference between what a texture has at vertices and the colour that belongs there.
float WorstAtVertices(const FitScene& scene) {
  float worst = 0;
  for (std::size_t k = 0; k < scene.uv_indices.size(); ++k) {
    const float* uv = &scene.uvs[2 * static_cast<std::size_t>(scene.uv_indices[k])];
    const float* p = &scene.positions[3 * static_cast<std::size_t>(scene.faces[k])];
    const int x = static_cast<int>(uv[0] * 128), y = static_cast<int>((1 - uv[1]) * 128);
    for (std::size_t c = 0; c < 3; ++c)
      worst = std::max(worst, std::abs(scene.texture.at(x, y)[c] - ColorAt(p, c)));
  }
  return worst;
}

void Paint(FitScene* scene) {
  // From vertices outwards; coarse, but exact at them.
  std::vector<bool> set(128 * 128, false);
  for (std::size_t k = 0; k < scene->uv_indices.size(); ++k) {
    const float* uv = &scene->uvs[2 * static_cast<std::size_t>(scene->uv_indices[k])];
    const float* p = &scene->positions[3 * static_cast<std::size_t>(scene->faces[k])];
    for (const int dx : {-1, 0, 1}) {
      for (const int dy : {-1, 0, 1}) {
        const int x = static_cast<int>(uv[0] * 128) + dx,
                  y = static_cast<int>((1 - uv[1]) * 128) + dy;
        for (std::size_t c = 0; c < 3; ++c) scene->texture.at(x, y)[c] = ColorAt(p, c);
      }
    }
  }
}

TEST(RemeshScene, KeepsTheSurfaceItsColoursAndTheMoments) {
  FitScene scene = ColoredSphere(4, 0.4f);
  Paint(&scene);
  ASSERT_LT(WorstAtVertices(scene), 0.05f);
  std::vector<ParameterBlock> blocks = {MakeBlock(scene, Parameter::kPositions, 0.01),
                                        MakeBlock(scene, Parameter::kTexture, 0.01)};
  for (std::size_t i = 0; i < blocks[0].m.size(); ++i) blocks[0].m[i] = blocks[0].values[i];
  for (float& m : blocks[1].m) m = 0.25f;
  blocks[0].steps = 7;
  const Workers workers(2);
  const auto made = RemeshScene(
      scene, blocks, {.shortest = 0.05f, .busy = 0.1f, .longest = 0.2f, .most_faces = 1000000},
      workers);
  ASSERT_TRUE(made.ok()) << made.status().message();
  EXPECT_GT(made->count.collapsed, 500);
  EXPECT_LT(made->scene.vertices(), scene.vertices() / 2);
  const ParameterBlock& positions = made->blocks[0];
  EXPECT_EQ(positions.steps, 7);
  ASSERT_EQ(positions.values.size(), made->scene.positions.size());
  for (std::size_t v = 0; v < made->scene.vertices(); ++v) {
    const float* p = &made->scene.positions[3 * v];
    EXPECT_NEAR(std::hypot(p[0], p[1], p[2]), 0.4f, 0.01f);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(positions.m[3 * v + c], p[c], 0.03f);
  }
  EXPECT_LT(WorstAtVertices(made->scene), 0.15f);
  EXPECT_GT(std::count_if(made->blocks[1].m.begin(), made->blocks[1].m.end(),
                          [](float m) { return std::abs(m - 0.25f) < 1e-6f; }),
            128 * 128);
  EXPECT_EQ(made->scene.cameras.size(), scene.cameras.size());
}

TEST(RemeshScene, IsTheSameForAnyNumberOfWorkers) {
  const FitScene scene = ColoredSphere(3, 0.4f);
  const std::vector<ParameterBlock> blocks = {MakeBlock(scene, Parameter::kPositions, 0.01),
                                              MakeBlock(scene, Parameter::kTexture, 0.01)};
  const RemeshLimits limits{
      .shortest = 0.05f, .busy = 0.1f, .longest = 0.2f, .most_faces = 1000000};
  const auto one = RemeshScene(scene, blocks, limits, Workers(1)),
             many = RemeshScene(scene, blocks, limits, Workers(5));
  ASSERT_TRUE(one.ok() && many.ok());
  EXPECT_EQ(one->scene.positions, many->scene.positions);
  EXPECT_EQ(one->scene.faces, many->scene.faces);
  EXPECT_EQ(one->scene.texture.pixels, many->scene.texture.pixels);
}

TEST(RemeshScene, SaysWhatItCannotCarry) {
  const FitScene scene = ColoredSphere(2, 0.4f);
  const auto uv = RemeshScene(scene, {MakeBlock(scene, Parameter::kUv, 0.01)}, {}, Workers(1));
  EXPECT_EQ(uv.status().code(), StatusCode::kInvalidArgument);
  FitScene open = scene;
  open.faces.resize(open.faces.size() - 3);
  EXPECT_EQ(RemeshScene(open, {}, {}, Workers(1)).status().code(), StatusCode::kInvalidArgument);
}

TEST(RemeshesUntil, AsOftenAsAskedForInTheFirstPart) {
  FitConfig config;
  config.steps = 100, config.remeshes = 3;
  const FitClock clock(config);
  std::vector<std::int64_t> steps;
  for (std::int64_t s = 1; s < config.steps; ++s)
    if (RemeshesUntil(config, clock.At(s)) > RemeshesUntil(config, clock.At(s - 1)))
      steps.push_back(s);
  EXPECT_EQ(steps, (std::vector<std::int64_t>{20, 40, 60}));
  config.remeshes = 0;
  EXPECT_EQ(RemeshesUntil(config, 1), 0);
}

class RemeshedFit : public TempFolderTest {
 protected:
  FitJob Job(const std::string& out) {
    const Status made =
        MakeViews(Torus(0.3f, 0.12f, 24, 12), {.views = 8, .held_out = 2, .size = 32},
                  folder_ / "views", OutputGuard(true), {}, stop_);
    EXPECT_TRUE(made.ok()) << made.message();
    FitJob job;
    job.input = ReadFitFolder(folder_ / "views", 0).value();
    job.out = folder_ / out;
    job.config.start = StartShape::kHull;
    job.config.steps = 40, job.config.remeshes = 3, job.config.texture_size = 128,
    job.config.timelapse = 0;
    job.config.checkpoint_every = 20;
    return job;
  }
  Bytes Read(const std::string& out) { return ReadFile(folder_ / out / "mesh.glb").value(); }
  StopFlag stop_ = false;
};

// Stopped before, between and after remeshings (at 8, 16, 24).
TEST_F(RemeshedFit, StoppedAndResumedEndsInTheSameBitsForAnyWorkers) {
  for (const bool colors : {false, true}) {
    const std::string whole = colors ? "whole_colors" : "whole", parts = whole + "_parts";
    FitJob job = Job(whole);
    job.config.vertex_colors = colors;
    ASSERT_TRUE(RunFit(job, Workers(1), {}, stop_).ok());
    job.out = folder_ / parts;
    for (const std::uint64_t stop_at : {5u, 16u, 20u, 29u}) {
      const auto stopped = RunFit(
          job, Workers(2), [&](const Progress& p) { stop_ = p.done == stop_at; }, stop_);
      ASSERT_EQ(stopped.status().code(), StatusCode::kCancelled) << stopped.status().message();
      stop_ = false, job.existing = ExistingRun::kContinue;
    }
    const auto resumed = RunFit(job, Workers(7), {}, stop_);
    ASSERT_TRUE(resumed.ok()) << resumed.status().message();
    EXPECT_EQ(resumed->first_step, 29);
    EXPECT_EQ(Read(whole), Read(parts));
  }
}

// A hull whose charts have no room in the texture gets a larger one; where four times the side is
// not enough, a fit that need not start from the hull says why it starts from a sphere.
TEST_F(RemeshedFit, ChartsWithoutRoomGetALargerTexture) {
  FitJob job = Job("run");
  job.config.texture_size = 16;
  const auto larger = PrepareFit(job, Workers(1));
  ASSERT_TRUE(larger.ok()) << larger.status().message();
  EXPECT_GT(larger->scene.texture.width, 16);
  EXPECT_LE(larger->scene.texture.width, 64);
  job.config.texture_size = 2, job.config.start = StartShape::kAuto;
  const auto sphere = PrepareFit(job, Workers(1));
  ASSERT_TRUE(sphere.ok()) << sphere.status().message();
  EXPECT_NE(sphere->note.find("no hull: a texture of 8 x 8"), std::string::npos) << sphere->note;
}

// What a sphere cannot: the hole of a ring.
TEST_F(RemeshedFit, KeepsTheHole) {
  FitJob job = Job("ring");
  ASSERT_TRUE(RunFit(job, Workers(2), {}, stop_).ok());
  const auto mesh = io::LoadMesh(job.out / "mesh.glb");
  ASSERT_TRUE(mesh.ok());
  for (const glm::vec3& p : mesh->mesh.positions) EXPECT_GT(std::hypot(p.x, p.z), 0.02f);
}

}  // namespace tilegrad::train::remesh_test
