// SPDX-License-Identifier: Apache-2.0
// The renderer at the limits of float: images and gradients are finite and within the
// derived tolerance of the references, or there is a clear error. A scene that fails is named by
// its number; TILEGRAD_SCENE=<number> runs that one alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/simd_target.h"
#include "raster/extremes/bound_check.h"
#include "raster/extremes/truth.h"
#include "support/expect.h"

namespace tilegrad::test::extremes_test {

struct SceneRange {
  std::uint64_t first, count;
  std::size_t most_faces;
};

CheckCounts CheckScenes(const SceneRange& range) {
  const Workers workers, one(1);
  const auto count = static_cast<std::size_t>(workers.count());
  std::vector<Renderer> renderers;
  for (std::size_t w = 0; w < count; ++w) renderers.push_back(RendererOn(one));
  std::vector<CheckCounts> counts(count);
  std::vector<std::string> failures(range.count);
  workers.For(range.count, [&](std::size_t n, std::size_t w) {
    const std::uint64_t number = range.first + n;
    const ExtremeScene scene = MakeExtremeScene(number, range.most_faces);
    const std::string wrong = CheckExtremeScene(scene, number, &renderers[w], &counts[w]);
    if (!wrong.empty()) {
      failures[n] = std::string(scene.kind) + ", scene " + std::to_string(number) + ": " + wrong;
    }
  });
  std::size_t failed = 0;
  for (const std::string& failure : failures) {
    if (!failure.empty() && ++failed <= 20) ADD_FAILURE() << ActiveTarget() << ": " << failure;
  }
  EXPECT_EQ(failed, 0u) << "of " << range.count << " scenes";
  for (std::size_t w = 1; w < count; ++w) counts[0].Add(counts[w]);
  return counts[0];
}

void Report(const SceneRange& range, const CheckCounts& c) {
  std::printf(
      "extremes: %zu scenes on %s: %zu numbers compared (%zu sharply), %zu only finite; gradients "
      "of %zu compared, of %zu too large for float; worst error / tolerance %.3g\n",
      static_cast<std::size_t>(range.count), ActiveTarget().c_str(), c.compared, c.sharp,
      c.left_out, c.gradients, c.overflows, c.worst);
  // The comparison means something: most numbers, sharply.
  EXPECT_GT(c.compared, 10 * c.left_out);
  EXPECT_GT(c.sharp, c.compared / 2);
  EXPECT_GT(c.gradients, range.count / 2);
}

void CheckOnTargets(std::uint64_t first, std::uint64_t count, std::size_t most_faces) {
  for (const std::string target : EveryTarget()) {
    const SceneRange range{first, count, most_faces};
    Report(range, CheckScenes(range));
    first += count;
  }
}

TEST(Extremes, ScenesOnEveryTarget) { CheckOnTargets(0, 700, 2000); }

TEST(ExtremesLong, HundredThousandScenes) { CheckOnTargets(1000000, 35000, 50000); }

void CheckHeap(std::size_t faces) {
  const Workers one(1);
  Renderer renderer = RendererOn(one);
  CheckCounts counts;
  EXPECT_EQ(CheckExtremeScene(MakeHeap(1, faces), 1, &renderer, &counts), "");
  EXPECT_GT(counts.compared, 0u);
}

TEST(Extremes, FiftyThousandFacesOnOnePixel) { CheckHeap(50000); }
TEST(ExtremesLong, AMillionFacesOnOnePixel) { CheckHeap(1000000); }

// Ids are integers all the way: floats count to 2^24 only.
TEST(ExtremesLong, FaceIdsBeyondWhatFloatsCount) {
  const std::int32_t id = (1 << 24) + 3;  // odd, and so no float
  TestScene<float> scene;
  scene.camera = {.fx = 1, .fy = 1, .cx = 0, .cy = 0, .near_plane = 0.5f};  // pixels are world
  scene.positions = {-20, 0, -1, -1, 1, -1, -1, -9, -1, 9, 1, -1};  // a point; half of the image
  scene.channels = 1;
  scene.attributes.assign(scene.vertex_count(), 0.5f);
  scene.faces.assign(3 * static_cast<std::size_t>(id), 0);
  scene.faces.insert(scene.faces.end(), {1, 2, 3});
  RenderOptions options;
  options.width = options.height = 8;
  const Workers workers;
  Renderer renderer = RendererOn(workers);
  Frame frame;
  const Scene view = scene.View();
  ASSERT_TRUE(renderer.Render({&view, 1}, options, {.color = false}, &frame).ok());
  const auto ids = frame.images().face_ids;
  const auto covered = std::count(ids.begin(), ids.end(), id);
  EXPECT_GT(covered, 10);
  EXPECT_EQ(covered + std::count(ids.begin(), ids.end(), -1), 64);
  const std::vector<float> d_attributes(64, 1.0f), d_alpha(64, 1.0f);
  std::vector<float> d_positions(scene.positions.size()), d_rows(scene.vertex_count());
  SceneGradients d{.positions = d_positions};
  d.attributes = d_rows;
  Ok(renderer.Backward(frame, {.alpha = d_alpha, .attributes = d_attributes}, {&d, 1}));
  EXPECT_EQ(d_rows[0], 0);
  EXPECT_NEAR(d_rows[1] + d_rows[2] + d_rows[3], static_cast<double>(covered), 1e-4);
}

TEST(Extremes, OneSceneAlone) {
  const char* number = std::getenv("TILEGRAD_SCENE");
  if (number == nullptr) GTEST_SKIP() << "TILEGRAD_SCENE names no scene";
  for (const std::string target : EveryTarget()) {
    const std::uint64_t n = std::strtoull(number, nullptr, 10);
    CheckScenes({n, 1, n < 1000000 ? 2000u : 50000u});
  }
}

// The promise of max_alpha_error, through the Renderer: no background pixel of any scene is farther
// from equation 6 over all faces than E, nor than Frame::alpha_error_bound says, rounding aside
// (docs/numerics.md, "Rounding"); and in whatever order the faces stand.

void CheckBound(std::uint64_t first, std::size_t count) {
  const Workers workers, one(1);
  std::vector<Renderer> renderers;
  for (int w = 0; w < workers.count(); ++w) renderers.push_back(RendererOn(one));
  std::vector<BoundSummary> scenes(count);
  workers.For(count, [&](std::size_t n, std::size_t w) {
    scenes[n] = CheckBoundScene({first + n}, &renderers[w]);
  });
  BoundSummary all;
  for (std::size_t n = 0; n < count; ++n) {
    const BoundSummary& s = scenes[n];
    EXPECT_TRUE(s.Kept()) << "scene " << first + n << ": " << s.failed;
    all.Add(s);
  }
  std::printf(
      "bound on alpha, %s: %zu scenes in two orders, %zu faces, %zu pixels (%zu between 0 and 1); "
      "largest violation of E %.3g, of the reported budget %.3g, by permuting %.3g; "
      "largest error %.3g E\n",
      ActiveTarget().c_str(), all.scenes, all.faces, all.pixels, all.between, all.over_budget,
      all.over_spent, all.order, all.share);
  EXPECT_GT(all.pixels, count);
  EXPECT_GT(all.between, count / 3);
}

TEST(AlphaBound, HoldsInEveryScene) {
  std::uint64_t first = 0;
  for (const std::string target : EveryTarget()) {
    CheckBound(first, 60);
    first += 60;
  }
}

TEST(AlphaBoundLong, TwentyThousandScenes) {
  CheckBound(1000000, 20000);
  for (const std::string target : EveryTarget()) {
    CheckBound(2000000, 1000);
  }
}

}  // namespace tilegrad::test::extremes_test
