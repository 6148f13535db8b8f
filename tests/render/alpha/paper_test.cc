// SPDX-License-Identifier: Apache-2.0
// AlphaRule::kPaper through the Renderer: published golden numbers, the reference in double, and
// that it is what it says it is (cut off, and dependent on the order of the faces).
#include "render/alpha/paper.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "raster/project.h"
#include "render/pipeline/frame_layout.h"
#include "render/pipeline/pipeline.h"
#include "render/pipeline/pipeline_ref.h"
#include "render/pipeline/test_scenes.h"
#include "support/shared_data.h"

namespace tilegrad::paper_test {

using Json = nlohmann::json;
using test::TestScene;

// One image of the vectors as a scene whose camera leaves NDC as they are, at depth 1.
template <class T>
TestScene<T> SceneOf(const Json& vectors, std::size_t image) {
  TestScene<T> out;
  out.channels = 0;
  const double width = vectors["width"], height = vectors["height"];
  out.camera.fx = out.camera.cx = T(width / 2), out.camera.fy = out.camera.cy = T(height / 2);
  for (const Json& face : vectors["face_vertices_image"][image]) {
    for (const Json& corner : face) {
      out.faces.push_back(static_cast<std::int32_t>(out.faces.size()));
      for (const T v : {T(corner[0].get<double>()), T(corner[1].get<double>()), T(-1)}) {
        out.positions.push_back(v);
      }
    }
  }
  return out;
}

RenderOptions OptionsOf(const Json& vectors, const Json& c) {
  RenderOptions options;
  options.width = vectors["width"], options.height = vectors["height"];
  options.delta = 1 / c["sigmainv"].get<double>();
  options.alpha_rule = AlphaRule::kPaper;
  options.paper_box = c["boxlen"], options.paper_faces = vectors["knum"];
  return options;
}

// The vectors' own visibility, so that their depth order need not be rebuilt.
std::vector<std::int32_t> FaceIds(const Json& vectors, std::size_t image) {
  std::vector<std::int32_t> out;
  for (const Json& row : vectors["selected_face_idx"][image]) {
    for (const Json& id : row) out.push_back(id);
  }
  return out;
}

void CheckMask(std::span<const double> alpha, const Json& golden, double tolerance) {
  std::size_t i = 0;
  for (const Json& row : golden) {
    for (const Json& value : row) EXPECT_NEAR(alpha[i++], value.get<double>(), tolerance);
  }
  EXPECT_EQ(i, alpha.size());
}

// The rule as a stage, with visibility given.
std::vector<float> AlphaOf(const PipelineScene& scene, const RenderOptions& options,
                           std::span<const std::int32_t> face_ids) {
  ImageScratch image;
  raster::Project(FaceSourceOf(scene, options), options.width, options.height, &image.buffers);
  image.mesh = image.buffers.View();
  PaperAlpha rule;
  rule.Begin(options, 1);
  rule.Prepare(0, image);
  std::vector<float> out(face_ids.size());
  const raster::SquareGrid bins = raster::BinGrid(options.width, options.height);
  for (std::size_t bin = 0; bin < bins.cells(); ++bin) {
    EXPECT_EQ(rule.Forward({image, {0, bin, bins.rect(bin)}, 0}, {face_ids, out, {}}), 0);
  }
  return out;
}

// Of alpha in float. Coordinates are below 1, and a distance is the difference of two of them, each
// rounded and projected: d is off by 4 half units of 1, and exp(-s d^2) by at most
// max_z 2 sqrt(z) exp(-z) sqrt(s) = sqrt(2 s / e) of that. Sums and the exponential add 1e-6.
double FloatTolerance(double sharpness) {
  const double distance = 4 * std::ldexp(1.0, -24);
  return std::sqrt(2 * sharpness / std::numbers::e) * distance + 1e-6;
}

TEST(PaperAlpha, GoldenNumbers) {
  const auto path = SharedFile("vectors/01_dibr_soft_mask_simple.json");
  if (!path) GTEST_SKIP() << "test vectors 01 not found; set TILEGRAD_SHARED to their folder";
  std::ifstream file(*path);
  const Json vectors = Json::parse(file);
  for (const Json& c : vectors["cases"]) {
    const RenderOptions options = OptionsOf(vectors, c);
    for (std::size_t image = 0; image < vectors["face_vertices_image"].size(); ++image) {
      SCOPED_TRACE("sigmainv " + c["sigmainv"].dump() + " boxlen " + c["boxlen"].dump());
      const auto ids = FaceIds(vectors, image);
      const auto truth = SceneOf<double>(vectors, image);
      PipelineFrameT<double> exact;
      RenderRefWithFaces<double>(truth.View(), options, {.attributes = false}, ids,
                                 {0, options.height}, &exact);
      CheckMask(exact.alpha, c["soft_mask_golden"][image], 1e-10);

      const auto scene = SceneOf<float>(vectors, image);
      const std::vector<float> alpha = AlphaOf(scene.View(), options, ids);
      CheckMask(std::vector<double>(alpha.begin(), alpha.end()), c["soft_mask_golden"][image],
                FloatTolerance(c["sigmainv"].get<double>()));
    }
  }
}

RenderOptions PaperOptions() {
  RenderOptions options;
  options.width = 37, options.height = 41;
  options.delta = 1e-3, options.alpha_rule = AlphaRule::kPaper;
  options.paper_box = 0.1, options.paper_faces = 5;
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
    different += !same, between += frame.alpha[i] > 0 && frame.alpha[i] < 1;
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
  options.width = 150, options.height = 133;
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
  options.paper_box = 0.2, options.paper_faces = 1;
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
