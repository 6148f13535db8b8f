// SPDX-License-Identifier: Apache-2.0
// The gradient of the whole chain of sections 5.2 and 5.3: loss <- renderer under the predicted
// lights <- texture, light and shape <- network weights.
#include "train/tasks/textured_image/step.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "scene/shapes.h"
#include "support/expect.h"
#include "train/gradient_check.h"

namespace tilegrad::train::textured_image_step_test {

constexpr int kSize = 16;

TexturedImageConfig TinyConfig(const std::string& light) {
  TexturedImageConfig config;
  config.network = {.code = {.base = 2, .most = 4, .levels = 2, .enlarge = 1, .latent = 6},
                    .hidden = 5,
                    .light_width = 4,
                    .sphere = {.level = 1, .smoothing = 1},
                    .output_deviation = 0.3};
  config.render = {.sharpness = 60, .sharpness_start = 60, .max_alpha_error = 0};
  config.light.model = light;
  config.batch = 2;
  return config;
}

TexturedMesh Ball() {
  Mesh ball = Icosphere(2, 0.45f);
  for (const glm::vec3& p : ball.positions) ball.colors.emplace_back(glm::vec3(0.5f) + p, 1.0f);
  return TexturedMesh(ball);
}

struct SmallProblem {
  TexturedImageConfig config;
  Workers workers{1};
  nn::Context context{workers, nn::DType::kF64};
  MeshCache meshes{1, 1 << 30, [](std::size_t) { return Result<TexturedMesh>(Ball()); }};
  TexturedStream stream;
  TexturedStep step;
  std::unique_ptr<Adversary> adversary;
  TexturedBatch batch;

  explicit SmallProblem(const TexturedImageConfig& c)
      : config(c), stream(JobOf(c), meshes, workers), step(context, c, kSize) {
    auto drawn = Ok(RenderBatch(context, stream, kSize, {{0, {}}, {0, {}}}, 6));
    batch = std::move(*drawn);
    auto made = Ok(Adversary::Make(context, c.adversary, {.seed = 5}));
    adversary = std::move(*made);
    step.SetAdversary(adversary.get());
  }
  static TexturedStream::Job JobOf(const TexturedImageConfig& config) {
    TexturedStream::Job job{config.stream, config.light, {}, kSize, 1};
    job.camera.lens.width = job.camera.lens.height = kSize;
    return job;
  }
  double LossNow() {
    StepValues values;
    step.Loss(step.Draw(batch, 0), batch, 0, &values);
    return values.loss;
  }
};

// Central differences in float64, as in chain_test.cc: the chain is piecewise smooth, h = 1e-6,
// gradients of single weights are 1e-4 and more. One entry in fifty may sit on a kink.
// `within`: of parameters whose names contain one of these words; all without.
void ExpectGradientsAgreeWithDifferences(const TexturedImageConfig& config,
                                         const std::vector<std::string>& within = {""}) {
  SmallProblem p(config);
  StepValues values;
  const TexturedRenders renders = p.step.Draw(p.batch, 0);
  const auto gradients =
      nn::Grad(p.step.Loss(renders, p.batch, 0, &values), p.step.weights().adam().parameters());
  ASSERT_TRUE(p.context.status().ok()) << p.context.status().message();
  EXPECT_LT(TermOf(values, "iou"), 0.95);  // silhouettes overlap
  const std::vector<nn::NamedVar> parameters = nn::Parameters(p.step.network().module());
  std::vector<nn::Var> chosen, of_chosen;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (std::ranges::none_of(within, [&](const std::string& word) {
          return parameters[i].name.find(word) != std::string::npos;
        }))
      continue;
    chosen.push_back(parameters[i].value);
    of_chosen.push_back(gradients[i]);
  }
  Rng rng(9);
  const Differences d = CompareWithDifferences(
      chosen, [&] { return p.LossNow(); }, of_chosen, 3, 1e-8, rng, 1e-3);
  EXPECT_LE(d.off, d.checked / 50) << "of " << d.checked;
  EXPECT_GT(2 * d.moving, d.checked);
}

TEST(TexturedStep, GradientsUnderLambertLight) {
  ExpectGradientsAgreeWithDifferences(TinyConfig("lambert"));
}

TEST(TexturedStep, GradientsUnderPhongLight) {
  TexturedImageConfig config = TinyConfig("phong");
  config.light.ambient = 0.2;
  ExpectGradientsAgreeWithDifferences(config);
}

TEST(TexturedStep, GradientsUnderHarmonics) {
  TexturedImageConfig config = TinyConfig("harmonics");
  config.network.symmetric_texture = true;
  ExpectGradientsAgreeWithDifferences(config);
}

TEST(TexturedStep, GradientsWithoutLightAndSkips) {
  TexturedImageConfig config = TinyConfig("none");
  config.network.code.skips = false;
  config.network.sphere.symmetric = false;
  ExpectGradientsAgreeWithDifferences(config);
}

TexturedImageConfig LookupConfig() {
  TexturedImageConfig config = TinyConfig("lambert");
  config.network.lookup = true;
  config.network.lookup_width = 4;
  config.network.code.skips = false;
  config.network.normalize = false;
  config.color = {.masked = true, .soft = 0.3, .own = 0.3, .pose = 2};
  return config;
}

// What is looked up has no gradient: what decides where (shape, camera, light) is left out.
TEST(TexturedStep, GradientsOfWhatMixesLookedUpColors) {
  ExpectGradientsAgreeWithDifferences(LookupConfig(), {"paint.", "map.", ".up."});
}

TEST(TexturedStep, GradientsOfAPalette) {
  TexturedImageConfig config = LookupConfig();
  config.network.palette = 3;
  ExpectGradientsAgreeWithDifferences(config, {"paint.", "map."});
}

// Targets are of a lattice and do not move with the weights, but for the few that jump.
TEST(TexturedStep, GradientsOfTheDistanceToLightsThatWereFound) {
  for (const char* model : {"lambert", "phong", "harmonics"}) {
    SCOPED_TRACE(model);
    TexturedImageConfig config = TinyConfig(model);
    config.color.light = 5;
    ExpectGradientsAgreeWithDifferences(config, {"light."});
  }
}

TEST(TexturedStep, GradientsOfTheCamera) {
  TexturedImageConfig config = LookupConfig();
  config.loss.color = 0;
  ExpectGradientsAgreeWithDifferences(config, {".down.", "latent.", "pose.", "shape."});
}

TexturedImageConfig AdversarialConfig() {
  TexturedImageConfig config = TinyConfig("lambert");
  config.adversary = {.weight = 3, .features = 2, .base = 3, .halvings = 2};
  return config;
}

// Of the network: through critic and renderer.
TEST(TexturedStep, GradientsOfTheAdversarialLoss) {
  ExpectGradientsAgreeWithDifferences(AdversarialConfig());
}

// Of the critic: its penalty is a derivative at the rendered picture already. Central differences
// in float64; leaky rectifiers kink, so one entry in ten may be off.
TEST(TexturedStep, GradientsOfTheCriticAtTheRenderedPicture) {
  for (const char* place : {"rendered", "interpolates"}) {
    TexturedImageConfig config = AdversarialConfig();
    config.adversary.place = place;
    config.adversary.penalty = 4;
    SmallProblem p(config);
    p.LossNow();
    StepValues values;
    const auto gradients = Ok(p.adversary->CriticGradients({2, 0}, &values));
    const auto loss = [&] {
      StepValues now;
      EXPECT_TRUE(p.adversary->CriticGradients({2, 0}, &now).ok());
      return 4 * TermOf(now, "critic_penalty") - TermOf(now, "critic_distance");
    };
    std::vector<nn::Var> of_weights;
    for (const auto& gradient : *gradients) of_weights.push_back(gradient.Value());
    Rng rng(4);
    const Differences d =
        CompareWithDifferences(nn::WeightsOf(*p.adversary->critic()), loss, of_weights, 4, 1e-8,
                               rng, std::numeric_limits<double>::infinity());
    EXPECT_LE(d.off, d.checked / 10) << place;
    EXPECT_GT(d.checked, 20);
  }
}

TEST(Adversary, RefusesWordsAndMissingFiles) {
  const Workers workers(1);
  nn::Context context(workers);
  ExpectMessage(Adversary::Make(context, {.place = "there"}, {}).status(), "\"there\"");
  ExpectMessage(Adversary::Make(context, {.perceptual = 1}, {}).status(), "network_file");
  AdversaryConfig absent{.perceptual = 1};
  absent.network_file = "/no/such/run";
  EXPECT_FALSE(Adversary::Make(context, absent, {}).ok());
}

TEST(TexturedStep, ColorsWaitUntilTheirShareOfTheRun) {
  TexturedImageConfig config = TinyConfig("none");
  config.schedule.steps = 10;
  config.color.from = 0.5;
  SmallProblem p(config);
  for (const auto& [step, counts] : {std::pair(4, false), {5, true}}) {
    StepValues values;
    p.step.Loss(p.step.Draw(p.batch, step), p.batch, step, &values);
    EXPECT_STREQ(values.terms[1].name, "color");
    EXPECT_EQ(values.terms[1].weight > 0, counts);
    EXPECT_GT(values.terms[1].value, 0);
  }
}

// Image 2m shows the view of input m, image 2m + 1 the other view of its object.
TEST(TexturedBatch, EachMeshIsHeldToBothViews) {
  SmallProblem p(TinyConfig("lambert"));
  ASSERT_EQ(p.batch.cameras.size(), 8u);
  const std::size_t want[] = {0, 1, 1, 0, 2, 3, 3, 2};
  const std::size_t pixels = kSize * kSize;
  for (std::size_t n = 0; n < 8; ++n) {
    const std::size_t m = want[n];
    EXPECT_EQ(InputOfImage(n), m);
    EXPECT_EQ(p.batch.cameras[n].rotation[0], p.batch.views[m].camera.rotation[0]);
    for (std::size_t i = 0; i < 3 * pixels; ++i) {
      ASSERT_EQ(p.batch.truth_colors.data<double>()[3 * pixels * n + i],
                p.batch.input.data<double>()[4 * pixels * m + i]);
    }
    for (std::size_t i = 0; i < pixels; ++i) {
      ASSERT_EQ(p.batch.truth_alpha.data<double>()[pixels * n + i],
                p.batch.input.data<double>()[4 * pixels * m + 3 * pixels + i]);
    }
  }
}

// A texture that is its own mirror image at x = 0: u and 1/2 - u.
TEST(TextureNetwork, SymmetricTexturesAre) {
  const Workers workers(1);
  nn::Context context(workers);
  TextureNetworkConfig config = TinyConfig("none").network;
  config.symmetric_texture = true;
  TextureNetwork network(context, config, {.lighting = Lighting::kNone}, kSize, 1);
  const Prediction out = network.Forward(
      nn::Constant(context, context.Full({1, 4, kSize, kSize}, 0.5)), nn::Mode::kEval);
  ASSERT_EQ(out.textures.shape(), (nn::Shape{1, 32, 32, 3}));
  const auto texel = [&](std::size_t row, std::size_t column) {
    return out.textures.value().data<float>()[(32 * row + column % 32) * 3];
  };
  double spread = 0;
  for (std::size_t row = 0; row < 32; ++row) {
    for (std::size_t i = 0; i < 32; ++i) {
      EXPECT_EQ(texel(row, i), texel(row, 47 - i));
      spread = std::max(spread, std::abs(static_cast<double>(texel(row, i) - texel(row, 3))));
    }
  }
  EXPECT_GT(spread, 1e-3);
  EXPECT_FALSE(out.directions.valid());
}

// Whatever the head says, unless lights may come from behind.
TEST(TextureNetwork, LightsFaceTheCamera) {
  const Workers workers(1);
  nn::Context context(workers);
  for (const bool facing : {true, false}) {
    TextureNetwork network(context, TinyConfig("lambert").network, {.facing = facing}, kSize, 1);
    for (nn::NamedVar& p : nn::Parameters(network.module())) {
      if (p.name == "light.out.bias") p.value.value().data<float>()[2] = -3;
    }
    const Prediction out = network.Forward(
        nn::Constant(context, context.Full({1, 4, kSize, kSize}, 0.5)), nn::Mode::kEval);
    EXPECT_EQ(out.directions.value().data<float>()[2] > 0, facing);
  }
}

TEST(TextureNetwork, ImageSizesAreChecked) {
  EXPECT_TRUE(CheckImageSize({.levels = 4}, 64).ok());
  ExpectMessage(CheckImageSize({.levels = 6}, 64), "smaller network.levels");
  EXPECT_FALSE(CheckImageSize({.levels = 4}, 72).ok());
}

}  // namespace tilegrad::train::textured_image_step_test
