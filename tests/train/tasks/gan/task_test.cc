// SPDX-License-Identifier: Apache-2.0
// The task goes the whole way on a small dataset: textures are extracted, shapes and then textures
// are trained, it is stopped and continues to the same bits, and makes meshes from noise.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "train/gradient_check.h"
#include "train/same_run.h"
#include "train/tasks/gan/model.h"
#include "train/tasks/gan/step.h"
#include "train/tasks/gan/watch.h"
#include "train/tiny_run_fixture.h"

namespace tilegrad::train::gan_task_test {

class GanTaskTest : public TinyRunTest {
 protected:
  GanTaskTest() : context_(workers_) {
    Ok(WriteNoiseDataset(folder_ / "data", Meshes::kBoxes));
    Ok(Train({.run = "textured", .config = kTinyTextured, .settings = {"schedule.steps=2"}})
           .status());
  }
  Result<RunOutcome> TrainGan(TinyRun gan) const {
    gan.config = kTinyGan;
    gan.settings.insert(gan.settings.begin(), "textures.run=" + (folder_ / "textured").string());
    return Train(gan);
  }
  std::vector<nn::NamedTensor> Final(const std::string& run) {
    return FinalTensors(context_, folder_ / run, 12);
  }

  nn::Context context_;
};

TEST_F(GanTaskTest, StoppedInEachStageAndContinuedEndsInTheSameBits) {
  Ok(TrainGan({"whole"}).status());
  const auto first = TrainGan({.run = "stopped", .workers = 1, .stop_at = 4});
  EXPECT_EQ(first.status().code(), StatusCode::kCancelled) << first.status().message();
  const auto second = TrainGan({.run = "stopped", .workers = 2, .stop_at = 9});
  EXPECT_EQ(second.status().code(), StatusCode::kCancelled) << second.status().message();
  const auto continued = Ok(TrainGan({.run = "stopped", .workers = 1}));
  EXPECT_GE(continued->first_step, 9);
  ExpectSameBits(context_, folder_ / "whole", folder_ / "stopped", 12);
  ExpectSameCurves(folder_ / "whole", folder_ / "stopped", 12);
}

TEST_F(GanTaskTest, ShapesLearnFirstAndThenStay) {
  ASSERT_TRUE(TrainGan({.run = "shape", .settings = {"schedule.steps=6"}}).ok());
  ASSERT_TRUE(TrainGan({"both"}).ok());
  const auto shape = Ok(LoadNewestCheckpoint(context_, folder_ / "shape"));
  const auto both = Final("both");
  int compared = 0, moved = 0;
  for (const nn::NamedTensor& tensor : shape->checkpoint.tensors) {
    const nn::Tensor* now = nn::Find(both, tensor.name);
    ASSERT_NE(now, nullptr) << tensor.name;
    const bool same = std::memcmp(now->raw(), tensor.value.raw(), now->bytes()) == 0;
    if (tensor.name.starts_with("best.shape.") || tensor.name.starts_with("critic_shape.")) {
      EXPECT_TRUE(same) << tensor.name;
      ++compared;
    }
    if (tensor.name.starts_with("texture.") && !same) ++moved;
  }
  EXPECT_GT(compared, 10);
  EXPECT_GT(moved, 5);
  // What is frozen is what scored best.
  for (const char* layer : {"fc1.weight", "fc3.bias"}) {
    const nn::Tensor *live = nn::Find(both, std::string("shape.") + layer),
                     *best = nn::Find(both, std::string("best.shape.") + layer);
    ASSERT_TRUE(live != nullptr && best != nullptr);
    EXPECT_EQ(std::memcmp(live->raw(), best->raw(), live->bytes()), 0) << layer;
  }
}

TEST_F(GanTaskTest, ASecondRunStartsWithTheShapesOfTheFirst) {
  ASSERT_TRUE(TrainGan({.run = "shape", .settings = {"schedule.steps=6"}}).ok());
  const auto second =
      Ok(TrainGan({.run = "second",
                   .settings = {"stages.shape=0", "start.run=" + (folder_ / "shape").string(),
                                "critic.texture_weight=0"}}));
  const auto first = LoadNewestCheckpoint(context_, folder_ / "shape");
  const auto state = Final("second");
  for (const char* name : {"best.shape.fc1.weight", "best.shape.fc3.weight"}) {
    const nn::Tensor *a = nn::Find(first->checkpoint.tensors, name), *b = nn::Find(state, name);
    ASSERT_TRUE(a != nullptr && b != nullptr);
    EXPECT_EQ(std::memcmp(a->raw(), b->raw(), a->bytes()), 0) << name;
  }
  for (const nn::NamedTensor& tensor : state)
    EXPECT_FALSE(tensor.name.starts_with("critic_texture.")) << tensor.name;
}

TEST_F(GanTaskTest, MakesMeshesAndAReport) {
  ASSERT_TRUE(TrainGan({"run"}).ok());
  const Path run = folder_ / "run";
  EXPECT_TRUE(std::filesystem::exists(run / "samples" / "step_00000012.png"));
  std::vector<std::vector<Mesh>> made;
  for (const int count : {1, 2}) {
    const Workers workers(count);
    const auto predictor = Ok(Predictor::Load(run, workers));
    auto& model = *predictor->model().generator();
    EXPECT_TRUE(model.has_textures());
    std::vector<float> codes = model.Code(5, 0);
    for (const float x : model.Code(5, 1)) codes.push_back(x);
    auto meshes = Ok(model.Generate(codes));
    ASSERT_EQ(meshes->size(), 2u);
    made.push_back(std::move(*meshes));
    ExpectMessage(predictor->Predict(std::vector<std::uint8_t>(4 * 32 * 32)).status(),
                  "predicts no meshes");
  }
  EXPECT_EQ(made[0][1].positions, made[1][1].positions);
  EXPECT_EQ(made[0][1].textures[0].image.pixels, made[1][1].textures[0].image.pixels);
  EXPECT_NE(made[0][0].positions, made[0][1].positions);
  EXPECT_EQ(made[0][0].textures[0].image.width, 32);

  const std::string text = Page("run", "data", 2);
  ExpectIn(text, "to generate textured objects from noise", "Wasserstein estimate",
           "sample 1 from behind", "Generated meshes, interactive",
           "tilegrad sample --score --run");
  ExpectNotIn(text, "Held-out models", "has not been evaluated", "unnamed creator");
}

TEST_F(GanTaskTest, WhatCannotBeIsAnError) {
  const auto said = [&](const std::string& setting) {
    return TrainGan({.run = "bad", .settings = {setting}}).status();
  };
  ExpectMessage(said("textures.run="), "textures.run", "configs/texture_quick.toml");
  ExpectMessage(said("textures.run=nowhere"), "textures.run = \"nowhere\"", "nowhere");
  ExpectMessage(said("network.texture_size=48"), "network.texture_size is 48", "power of two");
  ExpectMessage(said("network.texture_size=128"), "64 texels a side", "network.texture_size");
  ExpectMessage(said("network.shape_noise=7"), "network.shape_noise is 7", "network.noise, 6");
  ExpectMessage(said("stages.shape=0"), "stages.shape = 0", "start.run");
  ASSERT_TRUE(TrainGan({.run = "shape", .settings = {"schedule.steps=6"}}).ok());
  ExpectMessage(said("textures.run=" + (folder_ / "shape").string()), "extracts no textures");
}

// The gradient of the whole chain of section 5.5: critics <- pictures <- renderer <- shape and
// texture <- weights of the generator. And what is watched of sets.

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
  const std::vector<nn::Var> weights = nn::WeightsOf(module);
  const auto gradients = nn::Grad(p.Loss(stage), weights);
  ASSERT_TRUE(p.context.status().ok()) << p.context.status().message();
  Rng rng(9);
  const Differences d = CompareWithDifferences(
      weights, [&] { return p.Loss(stage).item(); }, gradients, 6, 1e-8, rng,
      std::numeric_limits<double>::infinity());
  EXPECT_LE(d.off, d.checked / 20) << "of " << d.checked;
  EXPECT_GT(2 * d.moving, d.checked);
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

}  // namespace tilegrad::train::gan_task_test
