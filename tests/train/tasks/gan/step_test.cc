// SPDX-License-Identifier: Apache-2.0
// The gradient of the whole chain of section 5.5: critics <- pictures <- renderer <- shape and
// texture <- weights of the generator. And what is watched of sets.
#include "train/tasks/gan/step.h"

#include <gtest/gtest.h>

#include <cmath>

#include "nn/nn.h"
#include "train/tasks/gan/model.h"
#include "train/tasks/gan/watch.h"

namespace tilegrad::train::gan_step_test {

constexpr int kSize = 16;

GanConfig TinyConfig() {
  GanConfig config;
  config.network = {.noise = 6,
                    .shape_noise = 4,
                    .hidden = 6,
                    .sphere = {.level = 1, .smoothing = 1},
                    .output_deviation = 0.1,
                    .texture_size = 16,
                    .texture_base = 2,
                    .texture_most = 4};
  config.critic.base = 2;
  config.critic.halvings = 2;
  config.render.sharpness = 60;
  config.render.max_alpha_error = 0;
  config.batch = 3;
  return config;
}

struct SmallProblem {
  GanConfig config;
  Workers workers{1};
  nn::Context context{workers, nn::DType::kF64};
  GanStep step;
  ShapeTextureGenerator generator;
  LearnedCritic silhouettes, pictures, maps;
  nn::Tensor noise;

  explicit SmallProblem(const GanConfig& c)
      : config(c),
        step(context, c, Rule()),
        generator(context, c.network, 1),
        silhouettes(context, JobOf(c, GanCritic::kSilhouettes)),
        pictures(context, JobOf(c, GanCritic::kPictures)),
        maps(context, JobOf(c, GanCritic::kTextures)),
        noise(step.Noise(7, 3, c.batch)) {}
  static CameraRule Rule() {
    CameraRule rule;
    rule.lens.width = rule.lens.height = kSize;
    return rule;
  }
  nn::Var Loss(GanStage stage) {
    StepValues values;
    LossSum sum(&values);
    const GeneratedObjects objects = step.Draw(generator, noise, stage, nn::Mode::kTrain);
    if (stage == GanStage::kShape) {
      silhouettes.AddGeneratorLoss(1, objects.cover, &sum);
      step.AddShapeLosses(generator, objects.shapes, &sum);
    } else {
      pictures.AddGeneratorLoss(1, objects.colors, &sum);
      maps.AddGeneratorLoss(1, objects.maps, &sum);
    }
    return sum.total();
  }
};

// Central differences in float64, as in chain_test.cc. One entry in twenty may sit on a kink: of
// leaky ReLUs, of depth.
void ExpectGradientsAgreeWithDifferences(const GanConfig& config, GanStage stage) {
  SmallProblem p(config);
  nn::Module& module = stage == GanStage::kShape ? p.generator.shape() : p.generator.texture();
  std::vector<nn::NamedVar> parameters = nn::Parameters(module);
  std::vector<nn::Var> vars;
  for (const nn::NamedVar& parameter : parameters) vars.push_back(parameter.value);
  const auto gradients = nn::Grad(p.Loss(stage), vars);
  ASSERT_TRUE(p.context.status().ok()) << p.context.status().message();
  Rng rng(9);
  int checked = 0, off = 0, moving = 0;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    nn::Tensor& weight = parameters[i].value.value();
    for (int k = 0; k < 6; ++k, ++checked) {
      const std::size_t at = rng.Below(weight.elements());
      const double h = 1e-6, before = weight.data<double>()[at];
      weight.data<double>()[at] = before + h;
      const double up = p.Loss(stage).item();
      weight.data<double>()[at] = before - h;
      const double down = p.Loss(stage).item();
      weight.data<double>()[at] = before;
      const double want = (up - down) / (2 * h), got = gradients[i].value().data<double>()[at];
      moving += std::abs(got) > 1e-9 ? 1 : 0;
      off += std::abs(got - want) <= 1e-5 * std::abs(want) + 1e-8 ? 0 : 1;
    }
  }
  EXPECT_LE(off, checked / 20) << "of " << checked;
  EXPECT_GT(2 * moving, checked);
}

TEST(GanStep, GradientsOfShapes) {
  ExpectGradientsAgreeWithDifferences(TinyConfig(), GanStage::kShape);
}

TEST(GanStep, GradientsOfTextures) {
  ExpectGradientsAgreeWithDifferences(TinyConfig(), GanStage::kTexture);
}

TEST(GanStep, GradientsOfWholeMapsInOneSampleAPixel) {
  GanConfig config = TinyConfig();
  config.network.symmetric_texture = false;
  config.stream.draw.samples = 1;
  config.views = kMostViews;
  ExpectGradientsAgreeWithDifferences(config, GanStage::kTexture);
}

TEST(GanStep, ShapesAreFrozenWhileTexturesLearn) {
  SmallProblem p(TinyConfig());
  std::vector<nn::Var> vars;
  for (const nn::NamedVar& parameter : nn::Parameters(p.generator.shape()))
    vars.push_back(parameter.value);
  for (const nn::Var& gradient : nn::Grad(p.Loss(GanStage::kTexture), vars)) {
    for (const double x : gradient.value().span<double>()) EXPECT_EQ(x, 0);
  }
}

TEST(GanGenerator, HalfAMapIsTheWholeOfASymmetricTexture) {
  SmallProblem p(TinyConfig());
  const nn::Var code = nn::Constant(p.context, p.noise);
  const nn::Var maps = p.generator.MakeMaps(code, nn::Mode::kEval);
  ASSERT_EQ(maps.shape(), (nn::Shape{3, 3, 16, 8}));
  const nn::Var textures = p.generator.Textures(maps);
  ASSERT_EQ(textures.shape(), (nn::Shape{3, 16, 16, 3}));
  const double* t = std::as_const(textures).value().data<double>();
  for (int row = 0; row < 16; ++row) {
    for (int i = 0; i < 16; ++i) {
      const int mirror = (16 / 2 - 1 - i + 16) % 16;
      for (int c = 0; c < 3; ++c)
        EXPECT_EQ(t[(row * 16 + i) * 3 + c], t[(row * 16 + mirror) * 3 + c]);
    }
  }
}

TEST(GanGenerator, TexturesStartAsTheMeanMap) {
  SmallProblem p(TinyConfig());
  for (nn::NamedVar& parameter : nn::Parameters(p.generator.texture()))
    nn::FillConstant(parameter.value.value(), 0);
  std::vector<float> mean;
  for (int i = 0; i < 3 * 16 * 8; ++i) mean.push_back(0.1f + 0.002f * static_cast<float>(i));
  p.generator.SetMeanMap(mean);
  const nn::Var maps = p.generator.MakeMaps(nn::Constant(p.context, p.noise), nn::Mode::kEval);
  for (std::size_t i = 0; i < maps.value().elements(); ++i) {
    EXPECT_NEAR(std::as_const(maps).value().data<double>()[i],
                static_cast<double>(mean[i % mean.size()]), 1e-6);
  }
}

TEST(GanGenerator, CodesBetweenTwoKeepTheirLength) {
  const std::vector<float> a = {3, 0, 0}, b = {0, 3, 0};
  const auto half = BetweenCodes(a, b, 0.5);
  EXPECT_NEAR(half[0], 3 / std::sqrt(2.0), 1e-6);
  EXPECT_NEAR(half[1], 3 / std::sqrt(2.0), 1e-6);
  EXPECT_EQ(BetweenCodes(a, b, 0), a);
  EXPECT_NEAR(BetweenCodes(a, a, 0.3)[0], 3, 1e-6);
}

// Two objects, two views of 2 x 2 pixels.
ObjectViews TwoObjects(nn::Context& context, std::vector<double> cover, double red) {
  std::vector<double> colors(2 * 6 * 4);
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t v = 0; v < 2; ++v) {
      for (std::size_t k = 0; k < 4; ++k)
        colors[((i * 2 + v) * 3) * 4 + k] = (i == 0 ? 0.0 : red) * cover[(i * 2 + v) * 4 + k];
    }
  }
  return {context.From({2, 6, 2, 2}, std::span<const double>(colors)),
          context.From({2, 2, 2, 2}, std::span<const double>(cover))};
}

TEST(GanWatch, SpreadsAreThoseOfPairs) {
  const Workers workers(2);
  nn::Context context(workers);
  const std::vector<double> apart = {1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0};
  const Spread far = SpreadOf(TwoObjects(context, apart, 0.5), workers);
  EXPECT_NEAR(far.shapes, 1, 1e-6);
  EXPECT_NEAR(far.colors, 0.5, 1e-6);
  const std::vector<double> half = {1, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  const Spread near = SpreadOf(TwoObjects(context, half, 0), workers);
  EXPECT_NEAR(near.shapes, 1.0 / 3, 1e-6);  // 1 - 2 / 3
  EXPECT_NEAR(near.colors, 0, 1e-6);
}

// Pixels of a cell that differ from each other are told from their mean.
TEST(GanWatch, BlurShowsInFeaturesOfColours) {
  const Workers workers(1);
  nn::Context context(workers);
  const auto features = [&](double a, double b) {
    std::vector<double> colors, cover(16 * 16, 1.0);
    for (int i = 0; i < 3 * 16 * 16; ++i) colors.push_back(i % 2 == 0 ? a : b);
    return ColorFeatures({context.From({1, 3, 16, 16}, std::span<const double>(colors)),
                          context.From({1, 1, 16, 16}, std::span<const double>(cover))});
  };
  const FeatureRows crisp = features(0.2, 0.6), blurred = features(0.4, 0.4);
  ASSERT_EQ(crisp.width, 2u * 3 * 64);
  for (std::size_t i = 0; i < crisp.width / 2; ++i) {
    EXPECT_NEAR(crisp.values[i], 0.4, 1e-6);
    EXPECT_NEAR(blurred.values[i], 0.4, 1e-6);
    EXPECT_NEAR(crisp.values[crisp.width / 2 + i], 0.2, 1e-6);
    EXPECT_NEAR(blurred.values[crisp.width / 2 + i], 0, 1e-6);
  }
}

TEST(GanWatch, OneObjectAgainAndAgainHasNoSpread) {
  SmallProblem p(TinyConfig());
  const auto views = [&](const nn::Tensor& noise) { return p.step.Show(p.generator, noise); };
  nn::Tensor same = p.step.Noise(7, 3, 12);
  for (std::size_t i = 0; i < same.elements(); ++i)
    same.data<double>()[i] = same.data<double>()[i % 6];
  const GanWatch watch(views(p.step.Noise(7, 4, 12)), p.workers);
  const auto collapsed = watch.Compare(views(same), GanStage::kShape);
  const auto alike = watch.Compare(views(p.step.Noise(7, 5, 12)), GanStage::kShape);
  ASSERT_TRUE(collapsed.ok() && alike.ok());
  EXPECT_LT(collapsed->shapes, 0.01);
  EXPECT_GT(alike->shapes, 0.5);
  EXPECT_GT(collapsed->distance, alike->distance);
}

}  // namespace tilegrad::train::gan_step_test
