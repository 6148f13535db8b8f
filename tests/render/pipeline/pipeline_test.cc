// SPDX-License-Identifier: Apache-2.0
// The tiled SIMD renderer, held to the naive reference in double on every instruction set.
#include "render/pipeline/pipeline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/simd_target.h"
#include "render/pipeline/pipeline_ref.h"
#include "render/pipeline/test_scenes.h"

namespace tilegrad::pipeline_test {

using test::TestScene;

constexpr double kEps = std::numeric_limits<float>::epsilon();

struct Case {
  const char* name;
  TestScene<float> (*make)(int width, int height, Rng*);
  int width, height;
  Interpolation mode;
  double delta;
};

TestScene<float> CornerSoup(int w, int h, Rng* r) {
  auto scene = test::TriangleSoup(30, 0.3, w, h, r);
  test::RandomAttributes(5, Rate::kCorner, r, &scene);
  return scene;
}
TestScene<float> Soup(int w, int h, Rng* r) { return test::TriangleSoup(60, 0.25, w, h, r); }
TestScene<float> Sphere(int w, int h, Rng* r) { return test::BumpySphere(14, 20, w, h, r); }
TestScene<float> ClippedSoup(int w, int h, Rng* r) { return test::SoupAroundCamera(30, w, h, r); }
TestScene<float> ClippedCorners(int w, int h, Rng* r) {
  auto scene = test::SoupAroundCamera(30, w, h, r);
  test::RandomAttributes(2, Rate::kCorner, r, &scene);
  return scene;
}
TestScene<float> ManyChannels(int w, int h, Rng* r) {
  auto scene = test::BumpySphere(8, 10, w, h, r);
  test::RandomAttributes(17, Rate::kVertex, r, &scene);
  return scene;
}

const Case kCases[] = {
    {"sphere64", Sphere, 64, 64, Interpolation::kPerspective, 1.0 / 7000},
    {"sphere_linear", Sphere, 50, 33, Interpolation::kScreenLinear, 1e-3},
    {"soup", Soup, 37, 61, Interpolation::kPerspective, 1e-3},
    {"corners", CornerSoup, 48, 40, Interpolation::kPerspective, 1e-3},
    {"clipped", ClippedSoup, 40, 40, Interpolation::kPerspective, 1e-3},
    {"clipped_corners", ClippedCorners, 33, 40, Interpolation::kScreenLinear, 1e-3},
    {"many_channels", ManyChannels, 40, 24, Interpolation::kPerspective, 1e-3},
    {"one_pixel", Sphere, 1, 1, Interpolation::kPerspective, 1e-3},
    {"one_row", Sphere, 70, 1, Interpolation::kPerspective, 1e-3},
};

RenderOptions OptionsOf(const Case& c) {
  RenderOptions options;
  options.width = c.width;
  options.height = c.height;
  options.interpolation = c.mode;
  options.delta = c.delta;
  options.max_alpha_error = 1e-7;
  return options;
}

constexpr Outputs kEverything{.depth = true, .barycentrics = true};

double MaxAbs(const auto& values) {
  double most = 0;
  for (const auto v : values) most = std::max(most, std::abs(static_cast<double>(v)));
  return most;
}

class OnTarget : public testing::TestWithParam<Case> {
 protected:
  void TearDown() override { ASSERT_TRUE(ForceTarget("").ok()); }
};

class AgainstReference : public OnTarget {};

// Screen coordinates are sums and products of a handful of floats of the size of the image, W: they
// err by about 4 eps W pixels. Over a face of height h pixels that moves a weight by 4 eps W / h.
// This is for h = 1/4; what is thinner (down to kFlatHeight, below which faces are flat) may err
// more, and tests say how many pixels may. 1e-5 is for the few operations on weights of up to 64
// (the distance of the corners of a tile's face from its first pixel).
double WeightTolerance(const RenderOptions& options) {
  return 16 * kEps * std::max(options.width, options.height) + 1e-5;
}

// Attributes are in [0, 1] and mix three weights.
double ImageTolerance(const RenderOptions& options) { return 4 * WeightTolerance(options); }

// Relative to the largest entry: the position gradient has one weight and one 1/height more.
double GradientTolerance(const RenderOptions& options) { return 8 * WeightTolerance(options); }

// Distances err by 4 eps W pixels = 8 eps in NDC, so A = exp(-z), z = d^2 / delta, errs by at most
// max(2 sqrt(z) exp(-z)) 8 eps / sqrt(delta) = 0.86 * 8 eps * 84 = 7e-5 for delta >= 1/7000.
constexpr double kAlphaTolerance = 1e-4;

TEST_P(AgainstReference, ForwardImages) {
  const RenderOptions options = OptionsOf(GetParam());
  Rng rng(11, 3);
  const auto scene = GetParam().make(options.width, options.height, &rng);
  const auto truth_scene = MeshCast<double>(scene);
  for (const auto& target : RunnableTargets()) {
    ASSERT_TRUE(ForceTarget(target).ok());
    const Workers workers(1);
    Pipeline renderer(workers);
    PipelineFrame frame;
    const PipelineScene views[] = {scene.View()};
    ASSERT_TRUE(renderer.Render(views, options, kEverything, &frame).ok());
    PipelineFrameT<double> truth;
    RenderRefWithFaces<double>(truth_scene.View(), options, kEverything, frame.face_ids,
                               {0, options.height}, &truth);
    // A pixel on a sliver may be off by much more than others: those are counted.
    std::size_t far_off = 0;
    const double tolerance = ImageTolerance(options);
    for (std::size_t i = 0; i < truth.attributes.size(); ++i) {
      far_off += !(std::abs(frame.attributes[i] - truth.attributes[i]) <= tolerance);
    }
    EXPECT_LE(far_off, truth.attributes.size() / 200) << target;
    for (std::size_t i = 0; i < truth.alpha.size(); ++i) {
      EXPECT_NEAR(frame.alpha[i], truth.alpha[i], kAlphaTolerance) << target << " pixel " << i;
    }
    for (std::size_t i = 0; i < truth.depth.size(); ++i) {
      if (std::isinf(truth.depth[i])) {
        EXPECT_TRUE(std::isinf(frame.depth[i])) << target << " pixel " << i;
      } else {
        EXPECT_NEAR(frame.depth[i] / truth.depth[i], 1, tolerance) << target << " pixel " << i;
      }
    }
    far_off = 0;
    for (std::size_t i = 0; i < truth.barycentrics.size(); ++i) {
      far_off += !(std::abs(frame.barycentrics[i] - truth.barycentrics[i]) <= tolerance);
    }
    EXPECT_LE(far_off, truth.barycentrics.size() / 200) << target;
  }
}

// Bit for bit against the reference in float: tests/raster/visibility_test.cc. Here in double.
TEST_P(AgainstReference, FaceIds) {
  const RenderOptions options = OptionsOf(GetParam());
  Rng rng(12, 3);
  const auto scene = GetParam().make(options.width, options.height, &rng);
  for (const auto& target : RunnableTargets()) {
    ASSERT_TRUE(ForceTarget(target).ok());
    const Workers workers(1);
    Pipeline renderer(workers);
    PipelineFrame frame;
    const PipelineScene views[] = {scene.View()};
    ASSERT_TRUE(
        renderer.Render(views, options, {.alpha = false, .attributes = false}, &frame).ok());
    // The double reference rounds vertices to subpixels from better coordinates: a pixel may differ
    // where a coordinate sits at the boundary of rounding and a centre within 1/1024 pixel. With
    // edges of about 1/4 of the pixels' number in length, 1/1024 of those centres are that near.
    const auto truth = FaceIdsRef(MeshCast<double>(scene).View(), options, {0, options.height});
    std::size_t different = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) different += frame.face_ids[i] != truth[i];
    EXPECT_LE(different, truth.size() / 250) << target;
  }
}

TEST_P(AgainstReference, Gradients) {
  const RenderOptions options = OptionsOf(GetParam());
  Rng rng(13, 3);
  const auto scene = GetParam().make(options.width, options.height, &rng);
  const auto truth_scene = MeshCast<double>(scene);
  const std::size_t pixels = static_cast<std::size_t>(options.width) * options.height;
  std::vector<float> d_attributes(pixels * static_cast<std::size_t>(scene.channels));
  std::vector<float> d_alpha(pixels);
  for (float& d : d_attributes) d = static_cast<float>(rng.Uniform(-1, 1));
  for (float& d : d_alpha) d = static_cast<float>(rng.Uniform(-1, 1));
  const std::vector<double> td_attributes(d_attributes.begin(), d_attributes.end());
  const std::vector<double> td_alpha(d_alpha.begin(), d_alpha.end());
  for (const auto& target : RunnableTargets()) {
    ASSERT_TRUE(ForceTarget(target).ok());
    const Workers workers(2);
    Pipeline renderer(workers);
    PipelineFrame frame;
    const PipelineScene views[] = {scene.View()};
    ASSERT_TRUE(renderer.Render(views, options, {}, &frame).ok());
    std::vector<float> positions(scene.positions.size()), attributes(scene.attributes.size());
    PipelineGradients d[] = {{positions, attributes, true, {}}};
    ASSERT_TRUE(renderer.Backward(views, options, frame, {d_attributes, d_alpha}, d).ok());
    std::vector<double> t_positions(positions.size()), t_attributes(attributes.size());
    PipelineGradientsT<double> t{t_positions, t_attributes, true, {}};
    RenderRefBackward<double>(truth_scene.View(), options, frame.face_ids,
                              {td_attributes, td_alpha}, {0, options.height}, &t);
    const auto check = [&](const char* what, const auto& got, const auto& expected, double bound) {
      const double scale = MaxAbs(expected);
      for (std::size_t i = 0; i < std::size(got); ++i) {
        EXPECT_NEAR(got[i], expected[i], bound * scale + 1e-6) << target << " " << what << " " << i;
      }
    };
    const double bound = GradientTolerance(options);
    check("positions", positions, t_positions, bound);
    check("attributes", attributes, t_attributes, bound);
    check("rotation", d[0].d_camera.rotation, t.d_camera.rotation, bound);
    check("translation", d[0].d_camera.translation, t.d_camera.translation, bound);
    const float lens[] = {d[0].d_camera.fx, d[0].d_camera.fy, d[0].d_camera.cx, d[0].d_camera.cy};
    const double t_lens[] = {t.d_camera.fx, t.d_camera.fy, t.d_camera.cx, t.d_camera.cy};
    check("lens", lens, t_lens, bound);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, AgainstReference, testing::ValuesIn(kCases),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace tilegrad::pipeline_test
