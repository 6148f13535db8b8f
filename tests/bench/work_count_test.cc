// SPDX-License-Identifier: Apache-2.0
// The counted work and the limit that follows from it.
#include "raster/work_count.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "raster/bench_scenes.h"
#include "support/expect.h"

namespace tilegrad::bench::work_count_test {

double SquaredToSegment(const double p[2], const float* a, const float* b) {
  const double e[2] = {b[0] - a[0], b[1] - a[1]}, q[2] = {p[0] - a[0], p[1] - a[1]};
  const double t = std::clamp((q[0] * e[0] + q[1] * e[1]) / (e[0] * e[0] + e[1] * e[1]), 0.0, 1.0);
  const double r[2] = {q[0] - t * e[0], q[1] - t * e[1]};
  return r[0] * r[0] + r[1] * r[1];
}

// Every face for every background pixel, without boxes.
double CountPairs(const CulledScene& s, const CulledFrame& frame) {
  double pairs = 0;
  for (int pixel = 0; pixel < s.width * s.height; ++pixel) {
    if (frame.face_ids[static_cast<std::size_t>(pixel)] >= 0) continue;
    const double p[2] = {(2 * (pixel % s.width) + 1.0) / s.width - 1,
                         1 - (2 * (pixel / s.width) + 1.0) / s.height};
    for (std::size_t f = 0; f < s.faces.size(); f += 3) {
      double least = 1e9;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto a = static_cast<std::size_t>(s.faces[f + k]);
        const auto b = static_cast<std::size_t>(s.faces[f + (k + 1) % 3]);
        least = std::min(least, SquaredToSegment(p, &s.ndc[2 * a], &s.ndc[2 * b]));
      }
      if (least <= 17.33 * s.delta) ++pairs;
    }
  }
  return pairs;
}

TEST(WorkCount, CountsWhatIsThere) {
  CulledBatch batch(BenchBatch({"small", 1, 48, 2}));
  batch.Forward({});
  const CulledFrame& frame = batch.frames[0];
  const WorkCount work = CountWork(batch.scenes[0], frame);
  std::set<std::int32_t> ids(frame.face_ids.begin(), frame.face_ids.end());
  const auto background = std::count(frame.face_ids.begin(), frame.face_ids.end(), -1);
  EXPECT_EQ(work.pixels, 48 * 48);
  EXPECT_EQ(work.faces, 320);
  EXPECT_EQ(work.covered, work.pixels - static_cast<double>(background));
  EXPECT_EQ(work.seen, static_cast<double>(ids.size() - 1));
  // Rounding decides about pairs on the border only.
  const double pairs = CountPairs(batch.scenes[0], frame);
  EXPECT_GT(pairs, 500);
  EXPECT_NEAR(work.pairs, pairs, 1e-3 * pairs);
  EXPECT_GE(8 * work.soft_blocks, work.pairs);
  EXPECT_LE(work.soft_blocks, work.pairs);
  // Front and back each cover the pixels once, in blocks of at most 8.
  EXPECT_GE(8 * work.hard_blocks, 2 * work.covered);
}

// What the renderer evaluates beside what has to be: whole vectors of faces, at more than 2^-25.
TEST(WorkCount, TheRendererEvaluatesLittleElse) {
  const Workers workers(1);
  for (const SceneSpec& spec : {SceneSpec{"S1", 4, 64, 3}, {"S3", 1, 256, 5}}) {
    BenchBatch batch(spec);
    batch.options.max_alpha_error = 1e-7;
    CulledBatch culled(batch);
    culled.Forward({});
    WorkCount work;
    for (std::size_t i = 0; i < culled.scenes.size(); ++i) {
      work += CountWork(culled.scenes[i], culled.frames[i]);
    }
    for (const std::string target : EveryTarget()) {
      Pipeline renderer(workers);
      FrameImages frame;
      Draw(batch, {.color = false}, &renderer, &frame);
      const RenderStats forward = renderer.stats();
      ASSERT_TRUE(renderer.Backward(batch.views, batch.options, frame,
                                    {batch.d_attributes, batch.d_alpha}, batch.d_scenes));
      const RenderStats backward = renderer.stats();
      for (const RenderStats* stats : {&forward, &backward}) {
        const double share = static_cast<double>(stats->pairs) / work.pairs;
        EXPECT_GT(share, 0.5) << target << ", " << spec.name;
        EXPECT_LT(share, 5) << target << ", " << spec.name;
        EXPECT_LE(stats->powers, 2 * stats->pairs);  // a column and a row for one pixel
      }
    }
  }
}

// Round numbers, whatever machine the defaults are those of.
constexpr MachineRates kRates{50e9, 6.3e9, 1.05e9, 20e9, 20.6e9};

// Counts and limits of a scene that were worked out by hand with the same rates.
TEST(WorkCount, LimitsByHand) {
  WorkCount work;
  work.pixels = 262144;
  work.faces = 81920;
  work.covered = 99090;
  work.seen = 28784;
  work.hard_blocks = 193704;
  work.soft_blocks = 92892;
  work.pairs = 207475;
  const Limit forward = ForwardLimit(work, {}, kRates), backward = BackwardLimit(work, {}, kRates);
  // Set-up 0.254, cover 0.372, shading 0.132, soft 0.124 (blocks: 0.446), memory 0.255.
  EXPECT_NEAR(forward.low, 0.254 + 0.372 + 0.132 + 0.124, 0.002);
  EXPECT_NEAR(forward.high, 0.254 + 0.372 + 0.132 + 0.446 + 0.255, 0.002);
  EXPECT_EQ(forward.bytes, 20 * work.pixels);
  // Covered pixels 0.089 and seen faces 0.411, soft 0.187 (blocks: 0.669), memory 0.315.
  EXPECT_NEAR(backward.low, 0.500 + 0.187, 0.002);
  EXPECT_NEAR(backward.high, 0.500 + 0.669 + 0.315, 0.002);
  EXPECT_EQ(backward.bytes, 24 * work.pixels);
}

TEST(WorkCount, WhatIsNotAskedForCostsNothing) {
  WorkCount work;
  work.pixels = 1000;
  work.faces = 1000;
  work.pairs = 1e6;
  work.soft_blocks = 2e5;
  const Limit both = ForwardLimit(work, {}, kRates);
  const Limit color = ForwardLimit(work, {true, false}, kRates);
  EXPECT_NEAR(both.low - color.low, 1e3 * 30 * 1e6 / kRates.lane_ops, 1e-9);
  EXPECT_EQ(color.bytes, 16 * work.pixels);
  EXPECT_EQ(ForwardLimit(work, {false, true}).bytes, 8 * work.pixels);
}

}  // namespace tilegrad::bench::work_count_test
