// SPDX-License-Identifier: Apache-2.0
// What the pipeline does besides numbers that the public interface does not show: what a frame
// must hold, how many pairs alpha evaluates; and scenes and images at the edge of what there is.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "render/pipeline/pipeline.h"
#include "render/pipeline/test_batch.h"

namespace tilegrad::pipeline_contract_test {

using test::Batch;
using test::kHeight;
using test::kWidth;
using test::Options;
using test::TestScene;

// What a caller must keep from Render to Backward: at most 16 bytes a pixel, whatever was rendered.
TEST(PipelineFrames, BackwardNeedsFaceIdsAndWhatAlphaLeaves) {
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
  frame.attributes.clear();
  frame.depth.clear();
  frame.barycentrics.clear();
  ASSERT_TRUE(backward().ok());
  EXPECT_EQ(batch.positions, positions);
  EXPECT_EQ(batch.attributes, attributes);
  const std::size_t bytes = frame.face_ids.size() * sizeof(frame.face_ids[0]) +
                            frame.alpha.size() * sizeof(frame.alpha[0]) +
                            frame.transmittance.size() * sizeof(frame.transmittance[0]);
  EXPECT_LE(bytes, 16 * batch.d_alpha.size());
}

// Both ways round at every pixel and face by some 1e-6 of the largest gradients.
TEST(PipelineFrames, BackwardWithoutTransmittanceIsTheSame) {
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

// What the soft mask evaluates: nothing unasked, what matters, less the more may be dropped.
TEST(PipelineStats, PairsOfAlphaAreCounted) {
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
}

TEST(PipelineErrors, BackwardChecksTheFrame) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {}, &frame).ok());
  const auto error = [&] {
    return renderer.Backward(batch.views, Options(), frame, {{}, batch.d_alpha}, batch.d_scenes)
        .message();
  };
  frame.face_ids[kWidth * kHeight + 2] = 40;
  EXPECT_EQ(error(), "scene 1: frame.face_ids[2] is 40, but the scene has 40 faces");
  frame.face_ids.pop_back();
  EXPECT_EQ(error(), "frame.face_ids has 4319 numbers, expected 4320");
}

TEST(PipelineErrors, AnOverflowingGradientIsNotReturnedSilently) {
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

// Weights sum to one, so the gradients of a channel at all vertices sum to those at all pixels that
// are covered.
TEST(PipelineEdgeCases, TheSmallestAndTheWidestImages) {
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

TEST(PipelineEdgeCases, BehindOffScreenAndDegenerateFacesAreFiniteBackground) {
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

TEST(PipelineEdgeCases, CulledFacesAreBackgroundWithAlpha) {
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
