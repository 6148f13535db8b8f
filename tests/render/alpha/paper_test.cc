// SPDX-License-Identifier: Apache-2.0
// AlphaRule::kPaper through the Renderer: the reference in double, and that it is what it says it
// is (cut off, and dependent on the order of the faces). Golden numbers:
// tests/python/test_kaolin.py.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/pipeline/test_scenes.h"
#include "render/reference.h"
#include "tilegrad/renderer.h"

namespace tilegrad::paper_test {

using test::TestScene;

constexpr Outputs kImages{.color = false};

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

// One scene, rendered.
struct Drawn {
  TestScene<float> mesh;
  Frame frame;

  Drawn(TestScene<float> scene, const RenderOptions& options) : mesh(std::move(scene)) {
    const Scene view = mesh.View();
    const Status status = Renderer({.threads = 2}).Render({&view, 1}, options, kImages, &frame);
    EXPECT_TRUE(status.ok()) << status.message();
  }
  std::span<const float> alpha() const { return frame.images().alpha; }
};

struct Gradients {
  std::vector<float> positions;
  Camera camera;
};

Gradients BackwardOf(const Drawn& drawn, const FrameGradients& d_frame, int threads) {
  Gradients out{std::vector<float>(drawn.mesh.positions.size()), {}};
  const SceneGradients d{.positions = out.positions, .camera = &out.camera};
  const Status status = Renderer({.threads = threads}).Backward(drawn.frame, d_frame, {&d, 1});
  EXPECT_TRUE(status.ok()) << status.message();
  return out;
}

// Not smooth: a face more or less in a box, or another nearest corner, changes things. Float and
// double disagree about that in few pixels, which are counted.
void CheckAgainstReference(const RenderOptions& options, std::size_t most_different) {
  Rng rng(4);
  const Drawn drawn(test::TriangleSoup(40, 0.15, options.width, options.height, &rng), options);
  const auto alpha = drawn.alpha();
  EXPECT_TRUE(std::isinf(drawn.frame.images().alpha_error_bound));
  const auto wide = MeshCast<double>(drawn.mesh);
  const SceneT<double> truth_scene = wide.View();
  FrameImagesT<double> truth;
  const auto ids = drawn.frame.images().face_ids;
  ReferenceRender(truth_scene, options, kImages, ids, &truth);
  std::vector<float> d_alpha(alpha.size());
  std::size_t different = 0, between = 0;
  for (std::size_t i = 0; i < alpha.size(); ++i) {
    // Distances err by 8 eps in NDC, so exp(-z) by at most 0.86 * 8 eps / sqrt(delta) = 3e-5.
    const bool same = std::abs(static_cast<double>(alpha[i]) - truth.alpha[i]) < 1e-4;
    different += !same;
    between += alpha[i] > 0 && alpha[i] < 1;
    if (same) d_alpha[i] = static_cast<float>(rng.Uniform(-1, 1));
  }
  EXPECT_LE(different, most_different);
  EXPECT_GT(between, 100u);
  const std::vector<double> t_d_alpha(d_alpha.begin(), d_alpha.end());
  std::vector<double> t_positions(drawn.mesh.positions.size());
  CameraT<double> t_camera;
  ReferenceRenderBackward<double>(truth_scene, options, ids, {.alpha = t_d_alpha},
                                  {.positions = t_positions, .camera = &t_camera});
  const Gradients got = BackwardOf(drawn, {.alpha = d_alpha}, 2);
  double largest = 0;
  for (const double d : t_positions) largest = std::max(largest, std::abs(d));
  EXPECT_GT(largest, 0);
  for (std::size_t i = 0; i < t_positions.size(); ++i) {
    EXPECT_NEAR(got.positions[i], t_positions[i], 1e-3 * largest);
  }
  EXPECT_NEAR(got.camera.fx / t_camera.fx, 1, 1e-2);
  for (const int threads : {1, 3}) {
    EXPECT_EQ(BackwardOf(drawn, {.alpha = d_alpha}, threads).positions, got.positions);
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
  const Drawn drawn(test::BumpySphere(4, 6, options.width, options.height, &rng), options);
  const std::vector<float> d_alpha(drawn.alpha().size(), 1.0f),
      d_attributes(3 * d_alpha.size(), 0.5f);
  const auto both = BackwardOf(drawn, {.alpha = d_alpha, .attributes = d_attributes}, 1).positions;
  const auto one = BackwardOf(drawn, {.attributes = d_attributes}, 1).positions;
  const auto alpha = BackwardOf(drawn, {.alpha = d_alpha}, 1).positions;
  for (std::size_t i = 0; i < both.size(); ++i) EXPECT_EQ(both[i], one[i] + alpha[i]);
}

TEST(PaperAlpha, IsCutOffAndDependsOnTheOrderOfFaces) {
  RenderOptions options = PaperOptions();
  options.paper_box = 0.2;
  options.paper_faces = 1;
  Rng rng(6);
  const auto scene = test::TriangleSoup(30, 0.1, options.width, options.height, &rng);
  auto reversed = scene;
  std::reverse(reversed.faces.begin(), reversed.faces.end());
  const Drawn forward(scene, options), backward(reversed, options);
  double most = 0;
  for (std::size_t i = 0; i < forward.alpha().size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(forward.alpha()[i] - backward.alpha()[i])));
  }
  EXPECT_GT(most, 0.1);
}

}  // namespace tilegrad::paper_test
