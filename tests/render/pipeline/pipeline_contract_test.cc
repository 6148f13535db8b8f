// SPDX-License-Identifier: Apache-2.0
// What renderer.h promises besides numbers: errors, same bits, no allocation, only what is asked
// for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <utility>

#include "base/sanitizers.h"
#include "render/pipeline/pipeline.h"
#include "render/pipeline/test_batch.h"
#include "support/allocation_count.h"

namespace tilegrad::pipeline_contract_test {

using test::Batch;
using test::g_allocations;
using test::kHeight;
using test::kWidth;
using test::Options;
using test::TestScene;

// With several workers the scratch of each grows until it has met the largest tile.
bool IsSteadySoon(const std::function<void()>& step) {
  for (int i = 0, quiet = 0; i < 100; ++i) {
    const long before = g_allocations;
    step();
    quiet = g_allocations == before ? quiet + 1 : 0;
    if (quiet == 10) return true;
  }
  return false;
}

void ExpectSteadyStateAllocatesNothing(Batch batch, int count) {
  const Workers workers(count);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const auto step = [&] {
    ASSERT_TRUE(
        renderer.Render(batch.views, batch.options, {.depth = true, .barycentrics = true}, &frame)
            .ok());
    ASSERT_TRUE(renderer
                    .Backward(batch.views, batch.options, frame,
                              {batch.d_attributes, batch.d_alpha}, batch.d_scenes)
                    .ok());
  };
  const long before_first = g_allocations;
  step();
  EXPECT_GT(g_allocations, before_first);  // the counter counts
  if (count > 1) {
    EXPECT_TRUE(IsSteadySoon(step));
    return;
  }
  const long before = g_allocations;
  for (int i = 0; i < 3; ++i) step();
  EXPECT_EQ(g_allocations - before, 0);
}

TEST(RendererMemory, SteadyStateAllocatesNothing) {
  for (int workers = 1; workers <= (kThreadSanitizer ? 1 : 3); ++workers) {
    ExpectSteadyStateAllocatesNothing(Batch(), workers);
    ExpectSteadyStateAllocatesNothing(Batch::Large(), workers);
  }
}

// What a caller must keep from Render to Backward: at most 16 bytes a pixel, whatever was rendered.
TEST(RendererMemory, BackwardNeedsFaceIdsAndWhatAlphaLeaves) {
  Batch batch = Batch::Large();
  const Workers workers(1);
  PipelineFrame frame;
  const auto backward = [&] {  // by a renderer that has not seen the batch before
    Pipeline renderer(workers);
    return renderer.Backward(batch.views, batch.options, frame, {batch.d_attributes, batch.d_alpha},
                             batch.d_scenes);
  };
  Pipeline renderer(workers);
  ASSERT_TRUE(
      renderer.Render(batch.views, batch.options, {.depth = true, .barycentrics = true}, &frame)
          .ok());
  ASSERT_TRUE(backward().ok());
  const auto positions = batch.positions, attributes = batch.attributes;
  frame.attributes.clear(), frame.depth.clear(), frame.barycentrics.clear();
  ASSERT_TRUE(backward().ok());
  EXPECT_EQ(batch.positions, positions);
  EXPECT_EQ(batch.attributes, attributes);
  const std::size_t bytes = frame.face_ids.size() * sizeof(frame.face_ids[0]) +
                            frame.alpha.size() * sizeof(frame.alpha[0]) +
                            frame.transmittance.size() * sizeof(frame.transmittance[0]);
  EXPECT_LE(bytes, 16 * batch.d_alpha.size());
}

// Both ways round at every pixel and face by some 1e-6 of the largest gradients.
TEST(RendererMemory, BackwardWithoutTransmittanceIsTheSame) {
  Batch batch = Batch::Large();
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const auto backward = [&] {
    EXPECT_TRUE(renderer
                    .Backward(batch.views, batch.options, frame,
                              {batch.d_attributes, batch.d_alpha}, batch.d_scenes)
                    .ok());
    return batch.positions;
  };
  ASSERT_TRUE(renderer.Render(batch.views, batch.options, {}, &frame).ok());
  ASSERT_EQ(frame.transmittance.size(), frame.alpha.size());
  const auto with = backward();
  frame.transmittance.clear();
  const auto without = backward();
  for (std::size_t n = 0; n < with.size(); ++n) {
    float largest = 0;
    for (const float d : with[n]) largest = std::max(largest, std::abs(d));
    for (std::size_t i = 0; i < with[n].size(); ++i) {
      EXPECT_NEAR(with[n][i], without[n][i], 1e-5f * largest) << "scene " << n << " number " << i;
    }
  }
  frame.transmittance.resize(3);
  const Status status =
      renderer.Backward(batch.views, batch.options, frame, {{}, batch.d_alpha}, batch.d_scenes);
  EXPECT_NE(status.message().find("frame.transmittance"), std::string::npos);
}

bool operator==(const RenderStats& a, const RenderStats& b) {
  return a.prepared == b.prepared && a.drawn == b.drawn && a.interpolated == b.interpolated &&
         a.alpha_parts == b.alpha_parts && a.merged == b.merged;
}

// Only what is asked for runs. Images of 150 x 139: 3 x 3 bins, 3 bands.
TEST(RendererRequest, WhatIsNotWantedIsNotComputed) {
  Batch batch = Batch::Large();
  for (const int count : {1, 3}) {
    const Workers workers(count);
    Pipeline renderer(workers);
    PipelineFrame frame;
    const auto forward = [&](const Outputs& request) {
      EXPECT_TRUE(renderer.Render(batch.views, batch.options, request, &frame).ok());
      return renderer.stats();
    };
    EXPECT_TRUE(forward({.alpha = false, .attributes = false}) == (RenderStats{3, 27, 0, 0, 0}));
    EXPECT_TRUE(forward({.alpha = false, .attributes = false, .depth = true}) ==
                (RenderStats{3, 27, 0, 0, 0}));
    EXPECT_TRUE(forward({.alpha = false}) == (RenderStats{3, 27, 27, 0, 0}));
    EXPECT_TRUE(forward({.attributes = false}) == (RenderStats{3, 27, 0, 27, 0}));
    EXPECT_TRUE(forward({.depth = true, .barycentrics = true}) == (RenderStats{3, 27, 27, 27, 0}));
    const auto backward = [&](const PipelineCotangents& d_frame, bool positions, bool attributes) {
      std::vector<PipelineGradients> wanted(3);
      for (std::size_t n = 0; n < 3; ++n) {
        if (positions) wanted[n].positions = batch.positions[n];
        if (attributes) wanted[n].attributes = batch.attributes[n];
      }
      EXPECT_TRUE(renderer.Backward(batch.views, batch.options, frame, d_frame, wanted).ok());
      return renderer.stats();
    };
    const PipelineCotangents colour{batch.d_attributes, {}}, alpha{{}, batch.d_alpha};
    const PipelineCotangents both{batch.d_attributes, batch.d_alpha};
    EXPECT_TRUE(backward(colour, true, true) == (RenderStats{0, 0, 9, 0, 6}));
    EXPECT_TRUE(backward(colour, false, true) == (RenderStats{0, 0, 9, 0, 3}));
    EXPECT_TRUE(backward(alpha, true, false).interpolated == 0);
    EXPECT_TRUE(backward(alpha, true, false).alpha_parts == 27);
    EXPECT_TRUE(backward(both, true, true) == (RenderStats{0, 0, 9, 27, 6}));
    EXPECT_TRUE(backward(both, false, false) == (RenderStats{0, 0, 0, 0, 0}));
  }
}

// What the soft mask evaluates: nothing unasked, what matters, less the more may be dropped.
TEST(RendererRequest, PairsOfAlphaAreCounted) {
  Batch batch = Batch::Large();
  const Workers workers(2);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const auto forward = [&](bool alpha, double error) {
    RenderOptions options = batch.options;
    options.max_alpha_error = error;
    EXPECT_TRUE(renderer.Render(batch.views, options, {.alpha = alpha}, &frame).ok());
    return renderer.stats();
  };
  EXPECT_EQ(forward(false, 0).pairs, 0);
  EXPECT_EQ(forward(false, 0).powers, 0);
  std::int64_t before = std::numeric_limits<std::int64_t>::max();
  for (const double error : {0.0, 1e-7, 1e-4, 1e-2}) {
    const RenderStats stats = forward(true, error);
    EXPECT_GT(stats.pairs, 0);
    EXPECT_GT(stats.powers, 0);
    EXPECT_LE(stats.pairs, before) << error;
    before = stats.pairs;
  }
  EXPECT_GT(forward(true, 1e-6).pairs, 0);
  const auto backward = [&](const PipelineCotangents& d_frame) {
    EXPECT_TRUE(renderer.Backward(batch.views, batch.options, frame, d_frame, batch.d_scenes).ok());
    return renderer.stats().pairs;
  };
  EXPECT_EQ(backward({batch.d_attributes, {}}), 0);
  EXPECT_GT(backward({{}, batch.d_alpha}), 0);
}

TEST(RendererRequest, WhatIsNotWantedTakesNoMemory) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const std::size_t pixels = batch.d_alpha.size();
  ASSERT_TRUE(
      renderer.Render(batch.views, Options(), {.alpha = false, .attributes = false}, &frame).ok());
  EXPECT_EQ(frame.face_ids.size(), pixels);
  EXPECT_TRUE(frame.attributes.empty() && frame.alpha.empty() && frame.depth.empty() &&
              frame.barycentrics.empty());
  EXPECT_EQ(frame.channels, 0);
  ASSERT_TRUE(
      renderer.Render(batch.views, Options(), {.depth = true, .barycentrics = true}, &frame).ok());
  EXPECT_EQ(frame.attributes.size(), 3 * pixels);
  EXPECT_EQ(frame.alpha.size(), pixels);
  EXPECT_EQ(frame.depth.size(), pixels);
  EXPECT_EQ(frame.barycentrics.size(), 2 * pixels);
}

TEST(RendererRequest, ImagesDoNotDependOnWhatElseIsWanted) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame all, one;
  ASSERT_TRUE(
      renderer.Render(batch.views, Options(), {.depth = true, .barycentrics = true}, &all).ok());
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {.alpha = false}, &one).ok());
  EXPECT_EQ(one.attributes, all.attributes);
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {.attributes = false}, &one).ok());
  EXPECT_EQ(one.alpha, all.alpha);
  ASSERT_TRUE(
      renderer
          .Render(batch.views, Options(),
                  {.alpha = false, .attributes = false, .depth = true, .barycentrics = true}, &one)
          .ok());
  EXPECT_EQ(one.depth, all.depth);
  EXPECT_EQ(one.barycentrics, all.barycentrics);
}

TEST(RendererRequest, GradientsThatAreNotWantedAreLeftAlone) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {}, &frame).ok());
  const PipelineCotangents d_frame{batch.d_attributes, batch.d_alpha};
  ASSERT_TRUE(renderer.Backward(batch.views, Options(), frame, d_frame, batch.d_scenes).ok());
  const auto positions = batch.positions;
  const auto attributes = batch.attributes;
  for (auto& d : batch.d_scenes) d = {{}, d.attributes, false, {}}, d.d_camera.fx = 123;
  ASSERT_TRUE(renderer.Backward(batch.views, Options(), frame, d_frame, batch.d_scenes).ok());
  EXPECT_EQ(batch.attributes, attributes);
  EXPECT_EQ(batch.d_scenes[0].d_camera.fx, 123);
  for (std::size_t n = 0; n < 3; ++n) batch.d_scenes[n] = {batch.positions[n], {}, false, {}};
  ASSERT_TRUE(renderer.Backward(batch.views, Options(), frame, d_frame, batch.d_scenes).ok());
  EXPECT_EQ(batch.positions, positions);
}

TEST(RendererRequest, AnEmptyImageGradientIsZero) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {}, &frame).ok());
  for (auto& d : batch.positions) std::fill(d.begin(), d.end(), 5.0f);
  ASSERT_TRUE(renderer.Backward(batch.views, Options(), frame, {}, batch.d_scenes).ok());
  for (const auto& array : {batch.positions, batch.attributes}) {
    for (const auto& d : array) {
      for (const float x : d) EXPECT_EQ(x, 0);
    }
  }
}

// What Render says about a scene that `spoil` has touched.
template <class Spoil>
std::string ErrorOf(const Spoil& spoil) {
  Batch batch;
  RenderOptions options = Options();
  spoil(&batch, &options);
  std::vector<PipelineScene> views;
  for (const auto& scene : batch.scenes) views.push_back(scene.View());
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const Status status = renderer.Render(views, options, {}, &frame);
  return status.ok() ? "ok" : status.message();
}

TEST(RendererErrors, NameSceneArrayAndIndex) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(ErrorOf([](Batch*, RenderOptions*) {}), "ok");
  EXPECT_EQ(ErrorOf([&](Batch* b, RenderOptions*) { b->scenes[1].positions[7] = nan; }),
            "scene 1: positions[7] is nan");
  EXPECT_EQ(ErrorOf([&](Batch* b, RenderOptions*) { b->scenes[2].attributes[4] = inf; }),
            "scene 2: attributes[4] is inf");
  EXPECT_EQ(ErrorOf([&](Batch* b, RenderOptions*) { b->scenes[0].camera.rotation[3] = nan; }),
            "scene 0: camera.rotation[3] is nan");
  EXPECT_EQ(ErrorOf([](Batch* b, RenderOptions*) { b->scenes[0].camera.near_plane = 0; }),
            "scene 0: camera.near_plane is 0, must be finite and > 0");
  EXPECT_EQ(ErrorOf([](Batch* b, RenderOptions*) { b->scenes[1].faces[5] = 120; }),
            "scene 1: faces[5] is 120, outside of [0, 120)");
  EXPECT_EQ(ErrorOf([](Batch* b, RenderOptions*) { b->scenes[1].faces[5] = -1; }),
            "scene 1: faces[5] is -1, outside of [0, 120)");
  EXPECT_EQ(ErrorOf([](Batch* b, RenderOptions*) { b->scenes[1].faces.pop_back(); }),
            "scene 1: faces must be [F,3], got 119 indices");
  EXPECT_EQ(ErrorOf([](Batch* b, RenderOptions*) { b->scenes[1].positions.pop_back(); }),
            "scene 1: positions must be [V,3], got 359 numbers");
  EXPECT_EQ(ErrorOf([](Batch* b, RenderOptions*) { b->scenes[1].attributes.pop_back(); }),
            "scene 1: attributes must be [120,3], got 359 numbers");
  EXPECT_EQ(ErrorOf([](Batch* b, RenderOptions*) {
              b->scenes[2].channels = 0, b->scenes[2].attributes.clear();
            }),
            "scene 2 has 0 channels, scene 0 has 3: a batch must agree");
  EXPECT_EQ(ErrorOf([](Batch*, RenderOptions* o) { o->width = 0; }),
            "options.width is 0, must be in 1..16384 pixels");
  EXPECT_EQ(ErrorOf([](Batch*, RenderOptions* o) { o->delta = 0; }),
            "options.delta is 0, must be finite and > 0");
  EXPECT_EQ(ErrorOf([](Batch*, RenderOptions* o) { o->max_alpha_error = 2; }),
            "options.max_alpha_error is 2, must be in [0, 1]");
}

TEST(RendererErrors, BackwardChecksTheFrame) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {}, &frame).ok());
  const auto error = [&](const PipelineCotangents& d_frame) {
    return renderer.Backward(batch.views, Options(), frame, d_frame, batch.d_scenes).message();
  };
  EXPECT_EQ(error({std::span(batch.d_attributes).first(3), {}}),
            "d_frame.attributes has 3 numbers, expected 12960");
  batch.d_alpha[9] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(error({{}, batch.d_alpha}), "d_frame.alpha[9] is nan");
  batch.d_alpha[9] = 0;
  frame.face_ids[kWidth * kHeight + 2] = 40;
  EXPECT_EQ(error({{}, batch.d_alpha}),
            "scene 1: frame.face_ids[2] is 40, but the scene has 40 faces");
  frame.face_ids.pop_back();
  EXPECT_EQ(error({{}, batch.d_alpha}), "frame.face_ids has 4319 numbers, expected 4320");
}

TEST(RendererErrors, AnOverflowingGradientIsNotReturnedSilently) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {}, &frame).ok());
  for (float& d : batch.d_attributes) d = std::numeric_limits<float>::max();
  const Status status =
      renderer.Backward(batch.views, Options(), frame, {batch.d_attributes, {}}, batch.d_scenes);
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_NE(status.message().find("the gradient overflows: d_scene."), std::string::npos)
      << status.message();
}

TEST(RendererEdgeCases, EmptyMeshesAndBatchesGiveBackground) {
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render({}, Options(), {}, &frame).ok());
  EXPECT_TRUE(frame.face_ids.empty());
  const PipelineScene empty[] = {PipelineScene{}};
  ASSERT_TRUE(
      renderer.Render(empty, Options(), {.depth = true, .barycentrics = true}, &frame).ok());
  for (const auto id : frame.face_ids) EXPECT_EQ(id, -1);
  for (const float alpha : frame.alpha) EXPECT_EQ(alpha, 0);
  for (const float depth : frame.depth) EXPECT_TRUE(std::isinf(depth));
  PipelineGradients d[] = {{{}, {}, true, {}}};
  const std::vector<float> d_alpha(frame.alpha.size(), 1.0f);
  ASSERT_TRUE(renderer.Backward(empty, Options(), frame, {{}, d_alpha}, d).ok());
  EXPECT_EQ(d[0].d_camera.fx, 0);
}

// Weights sum to one, so the gradients of a channel at all vertices sum to those at all pixels that
// are covered.
TEST(RendererEdgeCases, TheSmallestAndTheWidestImages) {
  const std::vector<float> positions = {-50, -50, 0, 50, -50, 0.1f, 0, 80, -0.1f};
  const std::vector<std::int32_t> faces = {0, 1, 2};
  const std::vector<float> attributes = {0.1f, 0.5f, 0.9f};
  const Workers workers(3);
  Pipeline renderer(workers);
  for (const auto& [width, height] : {std::pair{1, 1}, {16384, 1}, {1, 16384}, {16384, 5}}) {
    const Camera camera = OrbitCamera({40.0, width, height}, 90, 0, 3);
    const PipelineScene scenes[] = {{positions, faces, attributes, 1, Rate::kVertex, camera}};
    const RenderOptions options = Options(width, height);
    PipelineFrame frame;
    ASSERT_TRUE(renderer.Render(scenes, options, {}, &frame).ok());
    const std::vector<float> d_attributes(frame.face_ids.size(), 0.25f);
    std::vector<float> d_positions(9), d_rows(3);
    PipelineGradients d[] = {{d_positions, d_rows, false, {}}};
    ASSERT_TRUE(renderer.Backward(scenes, options, frame, {d_attributes, {}}, d).ok());
    const auto covered = std::count(frame.face_ids.begin(), frame.face_ids.end(), 0);
    EXPECT_GT(covered, 0);
    const double expected = 0.25 * static_cast<double>(covered);
    EXPECT_NEAR(d_rows[0] + d_rows[1] + d_rows[2], expected, 1e-4 * expected)
        << width << " x " << height;
  }
}

TEST(RendererEdgeCases, BehindOffScreenAndDegenerateFacesAreFiniteBackground) {
  TestScene<float> scene;
  scene.channels = 1;
  scene.positions = {0,    0, 5,  1,    0,    5,  0,    1, 5,    // behind
                     99,   0, -1, 99,   1,    -1, 98,   0, -1,   // beside
                     0,    0, -2, 0.5f, 0.5f, -2, 1,    1, -2,   // a line
                     0.2f, 0, -2, 0.2f, 0,    -2, 0.2f, 0, -2};  // a point
  for (int v = 0; v < 12; ++v) scene.faces.push_back(v);
  scene.attributes.assign(12, 1.0f);
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const PipelineScene views[] = {scene.View()};
  ASSERT_TRUE(
      renderer.Render(views, Options(), {.depth = true, .barycentrics = true}, &frame).ok());
  float most = 0;
  for (const auto id : frame.face_ids) EXPECT_EQ(id, -1);
  for (const float alpha : frame.alpha) most = std::max(most, alpha);
  EXPECT_GT(most, 0.1f);  // lines and points are in the soft mask
  std::vector<float> d_positions(scene.positions.size()), d_alpha(frame.alpha.size(), 1.0f);
  PipelineGradients d[] = {{d_positions, {}, true, {}}};
  ASSERT_TRUE(renderer.Backward(views, Options(), frame, {{}, d_alpha}, d).ok());
  for (std::size_t i = 0; i < d_positions.size(); ++i) {
    EXPECT_TRUE(std::isfinite(d_positions[i])) << i;
    if (i < 18) {
      EXPECT_EQ(d_positions[i], 0) << i;
    }
  }
}

TEST(RendererEdgeCases, CulledFacesAreBackgroundWithAlpha) {
  TestScene<float> scene;
  scene.channels = 0;
  scene.positions = {-0.1f, -0.1f, -2, 0, 0.1f, -2, 0.1f, -0.1f, -2};  // clockwise
  scene.faces = {0, 1, 2};
  RenderOptions options = Options();
  options.culling = FaceCulling::kBack;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const PipelineScene views[] = {scene.View()};
  ASSERT_TRUE(renderer.Render(views, options, {}, &frame).ok());
  float most = 0;
  for (const auto id : frame.face_ids) EXPECT_EQ(id, -1);
  for (const float alpha : frame.alpha) most = std::max(most, alpha);
  EXPECT_GT(most, 0.1f);
  options.culling = FaceCulling::kNone;
  ASSERT_TRUE(renderer.Render(views, options, {}, &frame).ok());
  EXPECT_GT(std::count(frame.face_ids.begin(), frame.face_ids.end(), 0), 0);
}

}  // namespace tilegrad::pipeline_contract_test
