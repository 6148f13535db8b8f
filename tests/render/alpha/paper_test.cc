// SPDX-License-Identifier: Apache-2.0
// AlphaRule::kPaper through the Renderer: the reference in double, and that it is what it says it
// is (cut off, and dependent on the order of the faces). Golden numbers:
// raster/soft_mask/paper_test.cc.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "render/pipeline/pipeline.h"
#include "render/pipeline/pipeline_ref.h"
#include "render/pipeline/test_scenes.h"

namespace tilegrad::paper_test {

using test::TestScene;

RenderOptions PaperOptions() {
  RenderOptions options;
  options.width = 37;
  options.height = 41;
  options.delta = 1e-3;
  options.alpha_rule = AlphaRule::kPaper;
  options.paper_box = 0.1;
  options.paper_faces = 5;
  return options;
}

struct Gradients {
  std::vector<float> positions;
  Camera camera;
};

Gradients BackwardOf(const TestScene<float>& scene, const RenderOptions& options,
                     const PipelineFrame& frame, std::span<const float> d_alpha, int worker_count) {
  const Workers workers(worker_count);
  Pipeline renderer(workers);
  const PipelineScene views[] = {scene.View()};
  Gradients out{std::vector<float>(scene.positions.size()), {}};
  PipelineGradients d[] = {{out.positions, {}, true, {}}};
  EXPECT_TRUE(renderer.Backward(views, options, frame, {{}, d_alpha}, d).ok());
  out.camera = d[0].d_camera;
  return out;
}

// Not smooth: a face more or less in a box, or another nearest corner, changes things. Float and
// double disagree about that in few pixels, which are counted.
void CheckAgainstReference(const RenderOptions& options, std::size_t most_different) {
  Rng rng(4);
  const auto scene = test::TriangleSoup(40, 0.15, options.width, options.height, &rng);
  const auto truth_scene = MeshCast<double>(scene);
  const Workers workers(2);
  Pipeline renderer(workers);
  const PipelineScene views[] = {scene.View()};
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(views, options, {}, &frame).ok());
  EXPECT_TRUE(std::isinf(frame.alpha_error_bound));
  PipelineFrameT<double> truth;
  RenderRefWithFaces<double>(truth_scene.View(), options, {}, frame.face_ids, {0, options.height},
                             &truth);
  std::vector<float> d_alpha(frame.alpha.size());
  std::size_t different = 0, between = 0;
  for (std::size_t i = 0; i < frame.alpha.size(); ++i) {
    // kAlphaTolerance of renderer_test.cc, for a kernel of this width.
    const bool same = std::abs(static_cast<double>(frame.alpha[i]) - truth.alpha[i]) < 1e-4;
    different += !same;
    between += frame.alpha[i] > 0 && frame.alpha[i] < 1;
    if (same) d_alpha[i] = static_cast<float>(rng.Uniform(-1, 1));
  }
  EXPECT_LE(different, most_different);
  EXPECT_GT(between, 100u);
  const std::vector<double> t_d_alpha(d_alpha.begin(), d_alpha.end());
  std::vector<double> t_positions(scene.positions.size());
  PipelineGradientsT<double> t{t_positions, {}, true, {}};
  RenderRefBackward<double>(truth_scene.View(), options, frame.face_ids, {{}, t_d_alpha},
                            {0, options.height}, &t);
  const Gradients got = BackwardOf(scene, options, frame, d_alpha, 2);
  double largest = 0;
  for (const double d : t_positions) largest = std::max(largest, std::abs(d));
  EXPECT_GT(largest, 0);
  for (std::size_t i = 0; i < t_positions.size(); ++i) {
    EXPECT_NEAR(got.positions[i], t_positions[i], 1e-3 * largest);
  }
  EXPECT_NEAR(got.camera.fx / t.d_camera.fx, 1, 1e-2);
  for (const int count : {1, 3}) {
    EXPECT_EQ(BackwardOf(scene, options, frame, d_alpha, count).positions, got.positions);
  }
}

TEST(PaperAlpha, RendererIsTheReference) { CheckAgainstReference(PaperOptions(), 10); }

// Several bins, some of them narrower than others.
TEST(PaperAlpha, RendererIsTheReferenceOnLargeImages) {
  RenderOptions options = PaperOptions();
  options.width = 150;
  options.height = 133;
  CheckAgainstReference(options, 100);
}

// Two gradients in one call are the sum of both.
TEST(PaperAlpha, AddsToTheGradientOfAttributes) {
  const RenderOptions options = PaperOptions();
  Rng rng(5);
  const auto scene = test::BumpySphere(4, 6, options.width, options.height, &rng);
  const Workers workers(1);
  Pipeline renderer(workers);
  const PipelineScene views[] = {scene.View()};
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(views, options, {}, &frame).ok());
  const std::vector<float> d_alpha(frame.alpha.size(), 1.0f),
      d_attributes(3 * d_alpha.size(), 0.5f);
  std::vector<float> both(scene.positions.size()), one(both.size());
  PipelineGradients d_both[] = {{both, {}, false, {}}}, d_one[] = {{one, {}, false, {}}};
  ASSERT_TRUE(renderer.Backward(views, options, frame, {d_attributes, d_alpha}, d_both).ok());
  ASSERT_TRUE(renderer.Backward(views, options, frame, {d_attributes, {}}, d_one).ok());
  const Gradients alpha = BackwardOf(scene, options, frame, d_alpha, 1);
  for (std::size_t i = 0; i < both.size(); ++i) EXPECT_EQ(both[i], one[i] + alpha.positions[i]);
}

TEST(PaperAlpha, IsCutOffAndDependsOnTheOrderOfFaces) {
  RenderOptions options = PaperOptions();
  options.paper_box = 0.2;
  options.paper_faces = 1;
  Rng rng(6);
  auto scene = test::TriangleSoup(30, 0.1, options.width, options.height, &rng);
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame;
  const auto alpha = [&] {
    const PipelineScene views[] = {scene.View()};
    EXPECT_TRUE(renderer.Render(views, options, {}, &frame).ok());
    return frame.alpha;
  };
  const auto forward = alpha();
  std::reverse(scene.faces.begin(), scene.faces.end());
  const auto backward = alpha();
  double most = 0;
  for (std::size_t i = 0; i < forward.size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(forward[i] - backward[i])));
  }
  EXPECT_GT(most, 0.1);
}

TEST(PaperAlpha, BadOptionsAndGradientsAreErrors) {
  RenderOptions options = PaperOptions();
  Rng rng(7);
  const auto scene = test::TriangleSoup(3, 0.2, options.width, options.height, &rng);
  const Workers workers(1);
  Pipeline renderer(workers);
  const PipelineScene views[] = {scene.View()};
  PipelineFrame frame;
  ASSERT_TRUE(renderer.Render(views, options, {}, &frame).ok());
  std::vector<float> d_alpha(frame.alpha.size()), d_positions(scene.positions.size());
  d_alpha[3] = std::numeric_limits<float>::quiet_NaN();
  PipelineGradients d[] = {{d_positions, {}, false, {}}};
  EXPECT_EQ(renderer.Backward(views, options, frame, {{}, d_alpha}, d).message(),
            "d_frame.alpha[3] is nan");
  options.paper_box = -1;
  EXPECT_EQ(renderer.Render(views, options, {}, &frame).message(),
            "options.paper_box is -1, must be finite and >= 0");
}

}  // namespace tilegrad::paper_test
