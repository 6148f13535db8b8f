// SPDX-License-Identifier: Apache-2.0
// The renderer on the tape: gradients of everything that a network may predict, in float64 against
// differences, and the float engine against float64.
#include "train/ops/render_op.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/rng.h"
#include "nn/nn.h"
#include "scene/shapes.h"
#include "train/gradient_check.h"

namespace tilegrad::train::render_op_test {

constexpr int kMeshes = 2, kViews = 2, kImages = kMeshes * kViews, kSide = 12;

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
  EXPECT_NE(context.TakeStatus().message().find("views each, but 3 cameras"), std::string::npos);

  const Batch sound(Lit(Lighting::kLambert));
  SceneRenderer renderer(workers);
  const auto v = static_cast<std::int64_t>(sound.ball.positions.size());
  const nn::Var positions = nn::Constant(context, context.Full({kMeshes, v, 3}, 0.5));
  RenderScenes(renderer,
               {.positions = positions,
                .light_directions = nn::Constant(context, context.Full({kMeshes, 3}, 1.0))},
               sound.job);
  EXPECT_NE(context.TakeStatus().message().find("light_directions has the shape [2, 3]"),
            std::string::npos);
}

}  // namespace tilegrad::train::render_op_test
