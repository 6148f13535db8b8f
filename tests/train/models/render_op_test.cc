// SPDX-License-Identifier: Apache-2.0
// The rivals on the tape: which images there are, what reaches the inputs, errors. Gradients
// through a whole step: chain_test.cc.
#include "train/models/render_op.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/rng.h"
#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "scene/camera.h"
#include "scene/light_frame.h"
#include "scene/shapes.h"
#include "shade/spherical_harmonics_ref.h"
#include "support/expect.h"
#include "train/gradient_check.h"
#include "train/models/camera_ops.h"

namespace tilegrad::train::render_op_test {

constexpr int kSide = 12;

struct Setting {
  Workers workers{1};
  nn::Context context{workers};
  RivalRenderer renderer{workers};
  Mesh ball = Icosphere(1, 0.5f);
  nn::Var positions, colors;
  RivalJob job;

  Setting() {
    const auto v = static_cast<std::int64_t>(ball.positions.size());
    const std::span<const float> flat(&ball.positions[0].x, 3 * ball.positions.size());
    positions = nn::Parameter(context, context.From({1, v, 3}, flat));
    colors = nn::Parameter(context, context.Full({1, v, 3}, 0.5));
    job.faces = {ball.faces[0].data(), 3 * ball.faces.size()};
    job.size = kSide;
    for (int n = 0; n < 2; ++n)
      job.cameras.push_back(OrbitCamera({50, kSide, kSide}, 30.0 + 70 * n, 10, 1.9));
  }
  RenderedImages Draw(const nn::Var& with_colors) {
    return RenderRival(renderer, positions, with_colors, job);
  }
  // The error that was noted, if there is one.
  std::string Error() { return context.TakeStatus().message(); }
};

double SizeOf(const nn::Var& x) { return nn::Sum(nn::Abs(x)).item(); }

TEST(RenderRival, DrawsColorsWhereThereAreSome) {
  for (const rivals::Rule rule : {rivals::Rule::kSoftRas, rivals::Rule::kN3mr}) {
    Setting s;
    s.job.options.rule = rule;
    s.job.options.softras.near_plane = 0.1;
    const RenderedImages alone = s.Draw({});
    EXPECT_FALSE(alone.colors.valid());
    EXPECT_EQ(alone.alpha.shape(), (nn::Shape{2, kSide, kSide}));
    const RenderedImages both = s.Draw(s.colors);
    EXPECT_EQ(both.colors.shape(), (nn::Shape{2, 3, kSide, kSide}));
    EXPECT_EQ(SizeOf(both.alpha - alone.alpha), 0);
    EXPECT_GT(SizeOf(both.colors), 10);
  }
}

// A loss of one image leaves the adjoint of the other empty.
TEST(RenderRival, EachImageMayPushAlone) {
  for (const rivals::Rule rule : {rivals::Rule::kSoftRas, rivals::Rule::kN3mr}) {
    Setting s;
    s.job.options.rule = rule;
    s.job.options.softras.near_plane = 0.1;
    const auto of_alpha = nn::Grad(nn::Sum(s.Draw(s.colors).alpha), {s.positions, s.colors});
    EXPECT_GT(SizeOf(of_alpha[0]), 0.01);
    EXPECT_EQ(SizeOf(of_alpha[1]), 0);
    const auto of_color = nn::Grad(nn::Sum(s.Draw(s.colors).colors), {s.positions, s.colors});
    EXPECT_GT(SizeOf(of_color[0]), 0);  // little: all is grey, and the face has all of the weight
    EXPECT_GT(SizeOf(of_color[1]), 1);
    EXPECT_EQ(s.Error(), "");
  }
}

// Cubes of one colour each, that of their face's corners in the mean, draw the same and get the
// same gradient.
TEST(RenderTextured, CubesOfOneColorAreColorsOfFaces) {
  Setting s;
  s.job.options.rule = rivals::Rule::kN3mr;
  Rng rng(3);
  std::vector<float> at_vertices(3 * s.ball.positions.size());
  for (float& x : at_vertices) x = static_cast<float>(rng.Uniform());
  const auto v = static_cast<std::int64_t>(s.ball.positions.size());
  const auto f = static_cast<std::int64_t>(s.ball.faces.size());
  s.colors =
      nn::Parameter(s.context, s.context.From({1, v, 3}, std::span<const float>(at_vertices)));
  nn::Var faces;
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<std::int32_t> corners;
    for (const Face& face : s.ball.faces) corners.push_back(face[k]);
    const nn::Var corner = nn::Gather(s.colors, 1, s.context.Indices(corners));
    faces = k == 0 ? corner : faces + corner;
  }
  const nn::Var cubes = nn::BroadcastTo(nn::Reshape(faces * (1.0 / 3), {1, f, 1, 3}), {1, f, 8, 3});
  const auto images = s.Draw(s.colors);
  const nn::Var value = images.colors;
  const auto want = nn::Grad(nn::Sum(nn::Square(images.colors)), {s.positions, s.colors});
  const auto drawn = RenderTextured(s.renderer, s.positions, cubes, s.job);
  EXPECT_LT(SizeOf(drawn.colors - nn::Detach(value)), 1e-3);
  const auto got = nn::Grad(nn::Sum(nn::Square(drawn.colors)), {s.positions, s.colors});
  EXPECT_GT(SizeOf(want[1]), 1);
  EXPECT_LT(SizeOf(got[1] - want[1]), 1e-3 * SizeOf(want[1]));
  EXPECT_LT(SizeOf(got[0] - want[0]), 1e-2 * SizeOf(want[0]));
  EXPECT_EQ(s.Error(), "");
  s.job.options.rule = rivals::Rule::kSoftRas;
  EXPECT_FALSE(RenderTextured(s.renderer, s.positions, cubes, s.job).alpha.valid());
  ExpectIn(s.Error(), "only N3MR");
}

TEST(RenderRival, ErrorsReachTheContext) {
  Setting s;
  const auto expect = [&](const std::string& part) {
    const std::string error = s.Error();
    ExpectIn(error, part);
  };
  s.job.options.softras.sigma = -1;
  EXPECT_FALSE(s.Draw({}).alpha.valid());
  expect("SoftRas: sigma is -1");
  s.job.options = {};
  s.job.size = 0;
  s.Draw({});
  expect("for images of 0 pixels a side");
  s.job.size = kSide;
  s.Draw(nn::Constant(s.context, s.context.Full({1, 7, 3}, 0.5)));
  expect("colors has 21 numbers, expected 126");
  s.positions = nn::Constant(s.context, s.context.Full({42, 3}, 0.5));
  s.Draw({});
  expect("positions have the shape [42, 3]");
}

// Lights of cameras in the world: the same light on the same surface, and gradients of the turn.

std::vector<Camera> SomeCameras() {
  return {OrbitCamera(Lens{}, 0, 0, 2), OrbitCamera(Lens{}, 50, 20, 2),
          OrbitCamera(Lens{}, 250, -70, 3)};
}

std::vector<double> Random(std::size_t count, Rng& rng) {
  std::vector<double> out(count);
  for (double& x : out) x = rng.Uniform(-1, 1);
  return out;
}

shade::Vec3<double> UnitNormal(Rng& rng) {
  const std::vector<double> v = Random(3, rng);
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return {v[0] / length, v[1] / length, v[2] / length};
}

shade::Vec3<double> ToCamera(const Camera& camera, const shade::Vec3<double>& n) {
  shade::Vec3<double> out = {};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k)
      out[static_cast<std::size_t>(i)] +=
          static_cast<double>(camera.rotation[3 * i + k]) * n[static_cast<std::size_t>(k)];
  }
  return out;
}

double LightAt(std::span<const double> sh, const shade::Vec3<double>& n) {
  return shade::ShLightRef(shade::ShPolynomialOf<double>(sh), n);
}

class LightFrames : public testing::Test {
 protected:
  const Workers workers_{1};
  nn::Context context_{workers_, nn::DType::kF64};
  const std::vector<Camera> cameras_ = SomeCameras();
};

// A normal of the world and the same one in the camera's axes have the same light. Rotations are of
// floats, so 1e-6.
TEST_F(LightFrames, HarmonicsShineOnTheSameSides) {
  Rng rng(2);
  const std::vector<double> seen = Random(9 * cameras_.size(), rng);
  const nn::Var world = HarmonicsToWorld(
      nn::Constant(context_, context_.From({3, 9}, std::span<const double>(seen))), cameras_);
  ASSERT_TRUE(context_.status().ok()) << context_.status().message();
  for (std::size_t n = 0; n < cameras_.size(); ++n) {
    std::array<float, 9> row;
    for (std::size_t i = 0; i < 9; ++i) row[i] = static_cast<float>(seen[9 * n + i]);
    const std::array<float, 9> alone = HarmonicsToWorld(row, cameras_[n]);
    const auto got = world.value().span<double>().subspan(9 * n, 9);
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(alone[i], got[i], 1e-6);
    for (int k = 0; k < 20; ++k) {
      const shade::Vec3<double> normal = UnitNormal(rng);
      EXPECT_NEAR(LightAt(got, normal),
                  LightAt(std::span(seen).subspan(9 * n, 9), ToCamera(cameras_[n], normal)), 1e-6);
    }
  }
}

TEST_F(LightFrames, DirectionsKeepTheirAngles) {
  Rng rng(3);
  const std::vector<double> seen = Random(9, rng);
  const nn::Var world = DirectionsToWorld(
      nn::Constant(context_, context_.From({3, 3}, std::span<const double>(seen))), cameras_);
  for (std::size_t n = 0; n < 3; ++n) {
    const double* const d = world.value().data<double>() + 3 * n;
    const shade::Vec3<double> back = ToCamera(cameras_[n], {d[0], d[1], d[2]});
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(back[i], seen[3 * n + i], 1e-6);
  }
}

TEST_F(LightFrames, GradientsAgreeWithDifferences) {
  Rng rng(4);
  for (const std::int64_t numbers : {3, 9}) {
    const nn::Var x = nn::RandomParameter(context_, {{3, numbers}}, rng),
                  w = nn::RandomConstant(context_, {3, numbers}, rng);
    const auto loss = [&] {
      return nn::Sum(
          w * (numbers == 3 ? DirectionsToWorld(x, cameras_) : HarmonicsToWorld(x, cameras_)));
    };
    nn::ExpectGradientBy({x}, loss, rng);
  }
}

TEST_F(LightFrames, OneLightForEachCamera) {
  DirectionsToWorld(nn::Constant(context_, context_.Full({2, 3}, 1.0)), cameras_);
  ExpectMessage(context_.TakeStatus(), "lights [2, 3] of 3 cameras");
}

// The renderer on the tape: gradients of everything that a network may predict, in float64 against
// differences, and the float engine against float64.

constexpr int kMeshes = 2, kViews = 2, kImages = kMeshes * kViews;

// Two bumpy balls from two sides each, and every kind of tensor.
struct Batch {
  Mesh ball = Icosphere(1, 0.5f);
  std::vector<float> uvs;
  std::vector<std::vector<double>> numbers;  // in the order of kShapes
  RenderJob job;

  explicit Batch(const ShadingModel& shading) {
    Rng rng(3);
    const auto fill = [&](std::size_t count, double low, double high) {
      std::vector<double> out(count);
      for (double& x : out) x = low + (high - low) * rng.Uniform();
      return out;
    };
    const std::size_t vertices = ball.positions.size();
    std::vector<double> positions, cameras;
    for (int b = 0; b < kMeshes; ++b) {
      for (const glm::vec3& p : ball.positions) {
        for (int c = 0; c < 3; ++c) positions.push_back(p[c] * (0.9 + 0.2 * rng.Uniform()));
      }
    }
    for (int n = 0; n < kImages; ++n) {
      const Camera c = OrbitCamera({50, kSide, kSide}, 25.0 + 90 * n, 15.0 - 20 * (n % 2), 1.9);
      job.cameras.push_back(c);
      cameras.insert(cameras.end(), c.rotation, c.rotation + 9);
      cameras.insert(cameras.end(), c.translation, c.translation + 3);
      cameras.insert(cameras.end(), {c.fx, c.fy, c.cx, c.cy});
    }
    for (std::size_t i = 0; i < 6 * ball.faces.size(); ++i)
      uvs.push_back(static_cast<float>(rng.Uniform()));
    numbers = {positions,
               fill(kMeshes * vertices * 3, 0.2, 1),
               fill(kMeshes * 5 * 7 * 3, 0.2, 1),
               fill(kImages * 3, 0.3, 1),
               fill(kImages, 3, 9),
               fill(kImages * 9, 0.1, 0.4),
               cameras,
               fill(6 * ball.faces.size(), 0, 1),
               fill(kImages * 9, 0.1, 0.6)};
    job.faces = {ball.faces[0].data(), 3 * ball.faces.size()};
    job.views = kViews;
    job.uvs = uvs;
    job.shading = shading;
    job.options.width = job.options.height = kSide;
    job.options.delta = 1e-2;
    job.options.max_alpha_error = 0;
  }
};

// Which of SceneVars' members are there, in their order.
using Parts = std::vector<bool>;

class Rendering {
 public:
  // `moving`: the part that alone is no constant; -1: all are none.
  Rendering(nn::Context& context, const Batch& batch, const Parts& parts, nn::DType type,
            int moving = -1)
      : batch_(batch), renderer_(context.workers()) {
    const auto v = static_cast<std::int64_t>(batch.ball.positions.size());
    const nn::Shape shapes[] = {
        {kMeshes, v, 3},    {kMeshes, v, 3},
        {kMeshes, 5, 7, 3}, {kImages, 3},
        {kImages},          {kImages, 9},
        {kImages, 16},      {static_cast<std::int64_t>(batch.ball.faces.size()), 3, 2},
        {kImages, 9}};
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (!parts[i]) continue;
      nn::Tensor tensor = context.Empty(shapes[i], type);
      nn::WithFloatType(type, [&]<class T>(T) {
        std::ranges::transform(batch.numbers[i], tensor.span<T>().begin(),
                               [](double x) { return static_cast<T>(x); });
      });
      const bool moves = moving < 0 || moving == static_cast<int>(i);
      vars_[i] = moves ? nn::Parameter(context, std::move(tensor))
                       : nn::Constant(context, std::move(tensor));
      parameters.push_back(vars_[i]);
    }
  }

  RenderedImages Draw(bool alpha = true) {
    RenderJob job = batch_.job;
    job.alpha = alpha;
    return RenderScenes(
        renderer_,
        {vars_[0], vars_[1], vars_[2], vars_[3], vars_[4], vars_[5], vars_[6], vars_[7], vars_[8]},
        job);
  }
  // Some number that depends on every pixel.
  nn::Var Loss() {
    const RenderedImages images = Draw();
    return nn::Sum(images.colors * images.colors) + nn::Sum(images.alpha * images.alpha);
  }

  std::vector<nn::Var> parameters;

 private:
  const Batch& batch_;
  SceneRenderer renderer_;
  nn::Var vars_[9];
};

// Coverage, clamps and the nearest feature are kinks: one entry in twenty may sit on one. The loss
// is some hundreds; gradients of single numbers are 1e-3 and more.
void CheckDifferences(const ShadingModel& shading, const Parts& parts) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const Batch batch(shading);
  Rendering rendering(context, batch, parts, nn::DType::kF64);
  const auto gradients = nn::Grad(rendering.Loss(), rendering.parameters);
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  Rng rng(8);
  const auto loss = [&] { return rendering.Loss().item(); };
  const Differences d =
      CompareWithDifferences(rendering.parameters, loss, gradients, 12, 1e-6, rng, 1e-3);
  EXPECT_LE(20 * d.off, d.checked);
  EXPECT_GT(2 * d.moving, d.checked);  // most of it is seen
}

constexpr ShadingModel Lit(Lighting lighting) { return {.lighting = lighting}; }

TEST(RenderScenes, ColorsAndCameras) {
  CheckDifferences({}, {true, true, false, false, false, false, true});
}

TEST(RenderScenes, TexturesUnderPhongLight) {
  CheckDifferences(Lit(Lighting::kPhong), {true, false, true, true, true, false, true});
}

TEST(RenderScenes, HarmonicsOverColorsAndTextures) {
  CheckDifferences(Lit(Lighting::kSphericalHarmonics),
                   {true, true, true, false, false, true, false});
}

TEST(RenderScenes, CoordinatesOfTexturesAndMaterials) {
  CheckDifferences(Lit(Lighting::kPhong),
                   {true, false, true, true, true, false, false, true, true});
}

// A rendering without alpha, of which some inputs are constants.
TEST(RenderScenes, WithoutAlphaAndOfConstants) {
  const Workers workers(1);
  const Batch batch(Lit(Lighting::kPhong));
  nn::Context context(workers);
  const Parts parts = {true, false, true, true, true, false, true, true, true};
  Rendering all(context, batch, parts, nn::DType::kF32);
  const auto want = nn::Grad(nn::Sum(all.Draw(false).colors), {all.parameters[1]})[0];
  Rendering one(context, batch, parts, nn::DType::kF32, /*moving=*/2);
  const RenderedImages drawn = one.Draw(false);
  EXPECT_FALSE(drawn.alpha.valid());
  const auto got = nn::Grad(nn::Sum(drawn.colors), {one.parameters[1]})[0];
  ASSERT_TRUE(context.status().ok()) << context.status().message();
  EXPECT_TRUE(std::ranges::equal(want.value().span<float>(), got.value().span<float>()));
  EXPECT_FALSE(std::ranges::all_of(got.value().span<float>(), [](float d) { return d == 0; }));
}

// Float against double: visibility is the same but for pixels on an edge (none here), sums of 144
// pixels of unit size round to 1e-5, and an exponential of the soft mask to 1e-6.
TEST(RenderScenes, FloatIsTheReference) {
  const Workers workers(2);
  const Batch batch(Lit(Lighting::kPhong));
  const Parts parts = {true, true, true, true, true, false, true};
  nn::Context context64(workers, nn::DType::kF64), context32(workers);
  Rendering exact(context64, batch, parts, nn::DType::kF64);
  Rendering fast(context32, batch, parts, nn::DType::kF32);
  const auto want = nn::Grad(exact.Loss(), exact.parameters);
  const auto got = nn::Grad(fast.Loss(), fast.parameters);
  ASSERT_TRUE(context32.status().ok()) << context32.status().message();
  for (std::size_t p = 0; p < want.size(); ++p) {
    double largest = 0, off = 0;
    for (std::size_t i = 0; i < want[p].value().elements(); ++i) {
      const double w = want[p].value().data<double>()[i];
      largest = std::max(largest, std::abs(w));
      off = std::max(off, std::abs(w - static_cast<double>(got[p].value().data<float>()[i])));
    }
    EXPECT_GT(largest, 0) << p;
    EXPECT_LT(off, 2e-3 * largest) << p;
  }
}

TEST(RenderScenes, WrongShapesAreErrors) {
  const Workers workers(1);
  Batch batch({});
  batch.job.cameras.pop_back();
  nn::Context context(workers);
  Rendering rendering(context, batch, {true}, nn::DType::kF32);
  rendering.Loss();
  ExpectMessage(context.TakeStatus(), "views each, but 3 cameras");

  const Batch sound(Lit(Lighting::kLambert));
  SceneRenderer renderer(workers);
  const auto v = static_cast<std::int64_t>(sound.ball.positions.size());
  const nn::Var positions = nn::Constant(context, context.Full({kMeshes, v, 3}, 0.5));
  RenderScenes(renderer,
               {.positions = positions,
                .light_directions = nn::Constant(context, context.Full({kMeshes, 3}, 1.0))},
               sound.job);
  ExpectMessage(context.TakeStatus(), "light_directions has the shape [2, 3]");
}

}  // namespace tilegrad::train::render_op_test
