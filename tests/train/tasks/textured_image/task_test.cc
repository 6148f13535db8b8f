// SPDX-License-Identifier: Apache-2.0
// The task goes the whole way on a small dataset: it trains, predicts textured meshes, is evaluated
// by Table 2 and reported.
#include <gtest/gtest.h>

#include <cmath>

#include "scene/camera.h"
#include "scene/light_frame.h"
#include "support/source_dir.h"
#include "train/run/log.h"
#include "train/tasks/textured_image/light_search.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/step.h"
#include "train/tiny_run_fixture.h"

namespace tilegrad::train::task_test {

class TexturedTask : public TinyRunTest {
 protected:
  TexturedTask() { Ok(WriteNoiseDataset(folder_ / "data", Meshes::kBoxes)); }
  Result<RunOutcome> TrainTextured(std::vector<std::string> settings,
                                   const std::string& run = "run") const {
    settings.push_back("schedule.steps=12");
    return Train({.run = run, .config = kTinyTextured, .settings = settings});
  }
};

TEST_F(TexturedTask, TrainsPredictsIsEvaluatedAndReported) {
  EXPECT_TRUE(Ok(TrainTextured({}))->finished);
  const Path run = folder_ / "run";
  EXPECT_TRUE(std::filesystem::exists(run / "stream.png"));
  EXPECT_TRUE(std::filesystem::exists(run / "samples" / "step_00000010.png"));
  const auto predictor = Ok(Predictor::Load(run, workers_));
  const auto meshes = Ok(predictor->Predict(std::vector<std::uint8_t>(4 * 32 * 32, 128)));
  ASSERT_EQ((*meshes)[0].textures.size(), 1u);
  EXPECT_EQ((*meshes)[0].textures[0].image.width, 64);
  EXPECT_EQ((*meshes)[0].corner_uvs.size(), 3 * (*meshes)[0].faces.size());

  const auto evaluation = Ok(Evaluate("run", "data", 3));
  ASSERT_EQ(evaluation->rows.size(), 7u);
  const Score &dark = evaluation->rows[0].mean, &mean = evaluation->rows[1].mean,
              &ours = evaluation->rows[6].mean;
  // A search that knows shape and texture finds the light but for what edges of pixels hide.
  const Score &best = evaluation->rows[2].mean, &search = evaluation->rows[5].mean;
  EXPECT_LT(*best.light_angle, 12);
  EXPECT_GT(*search.light_angle, *best.light_angle);
  EXPECT_EQ(best.iou, 1);
  EXPECT_EQ(best.texture_l1, 0);
  EXPECT_EQ(search.iou, ours.iou);
  EXPECT_EQ(search.texture_l1, ours.texture_l1);
  EXPECT_FALSE(dark.light_angle);
  EXPECT_GT(*mean.light_angle, 5);
  EXPECT_EQ(*dark.texture_l1, *ours.texture_l1);
  EXPECT_GT(*dark.lit_l1, *ours.lit_l1);  // lit pictures are darker than textures
  ExpectIn(FormatTable(*evaluation), "texture + light L1");
  ASSERT_TRUE(WriteEvaluation(run, *evaluation).ok());
  const auto read = ReadEvaluation(run);
  ASSERT_TRUE(read.ok() && read->has_value());
  EXPECT_EQ((*read)->rows[6].mean.light_angle, ours.light_angle);

  ExpectIn(FormatTable(**read), "light / constant", "Search: the light");
  ExpectIn(Page("run", "data", 2), "to predict shape, texture and light", "texture + light L1",
           "true light", "another view", "Angle of the light");
}

TEST_F(TexturedTask, TrainsAndIsEvaluatedByN3mr) {
  Ok(TrainTextured({"render.rule=n3mr"}).status());
  EXPECT_EQ(Ok(Evaluate("run", "data", 2))->rows.size(), 7u);
}

TEST_F(TexturedTask, WhatDoesNotFitIsAnError) {
  const std::pair<std::vector<std::string>, const char*> cases[] = {
      {{"render.rule=softras", "light.model=lambert"}, "\"softras\""},  // it draws no textures
      {{"render.rule=n3mr", "light.model=phong"}, "N3MR has no light.model"},
      {{"light.model=neon"}, "light.model is \"neon\""},
      {{"start.run=/no/run"}, "start.run = \"/no/run\""}};
  for (const auto& [settings, part] : cases) ExpectMessage(TrainTextured(settings).status(), part);
}

TEST_F(TexturedTask, WithoutLightThereIsNoLightToScore) {
  Ok(TrainTextured({"light.model=none"}).status());
  const auto evaluation = Ok(Evaluate("run", "data", 2));
  ASSERT_EQ(evaluation->rows.size(), 1u);
  EXPECT_FALSE(evaluation->rows[0].mean.light_angle);
}

// The second stage of section 5.3 goes on from the network of the first.
TEST_F(TexturedTask, StartsAsTheNetworkOfAnotherRun) {
  const Path first = folder_ / "run", second = folder_ / "second";
  Ok(TrainTextured({}).status());
  Ok(TrainTextured(
         {"start.run=" + first.string(), "optimizer.learning_rate=0", "adversarial.weight=0.5",
          "adversarial.base=4", "adversarial.halvings=2", "adversarial.learning_rate=1e-3"},
         "second")
         .status());
  nn::Context context(workers_);
  const auto before = FindCheckpoint(context, first), after = FindCheckpoint(context, second);
  ASSERT_TRUE(before.ok() && after.ok());
  int same = 0, critic = 0;
  for (const nn::NamedTensor& tensor : before->checkpoint.tensors) {
    if (tensor.name.starts_with("adam") || tensor.name.find("running_") != std::string::npos)
      continue;
    const nn::Tensor* now = nn::Find(after->checkpoint.tensors, tensor.name);
    ASSERT_NE(now, nullptr) << tensor.name;
    const auto a = tensor.value.span<float>(), b = now->span<float>();
    EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin())) << tensor.name;
    ++same;
  }
  for (const nn::NamedTensor& tensor : after->checkpoint.tensors)
    critic += tensor.name.starts_with("critic.adam.m") ? 1 : 0;
  EXPECT_GT(same, 20);
  EXPECT_EQ(critic, 6);  // weights and biases of two halvings and the scores
  const auto log = Ok(ReadLog(second));
  std::string names;
  for (const auto& value : log->back().values) names += value.first + " ";
  ExpectIn(names, "adversarial ", "critic_distance critic_penalty ");
}

TEST(TexturedConfigs, HaveSizesThatGoWithTheirImages) {
  for (const auto& [file, size] : {std::pair("texture_quick", 64),
                                   {"texture_adversarial", 64},
                                   {"table2", 128},
                                   {"texture_paper", 256},
                                   {"texture_adversarial_paper", 256}}) {
    const Path path = Path(TILEGRAD_SOURCE_DIR) / "configs" / (std::string(file) + ".toml");
    auto config = Ok(ReadConfig(path));
    const std::int64_t levels = ValueOf<std::int64_t>(*config, "network.levels");
    EXPECT_TRUE(CheckImageSize({.levels = levels}, size).ok());
  }
}

// Pictures of a painted ball under known lights, whose directions are found again.

constexpr int kSize = 32;
constexpr std::size_t kPixels = std::size_t{kSize} * kSize;
using Direction = std::array<float, 3>;

struct Ball {
  std::vector<double> texture = std::vector<double>(3 * kPixels);
  std::vector<double> normals = texture;
  std::vector<double> picture = texture;
  std::vector<double> cover = std::vector<double>(kPixels);

  // As a camera at infinity sees it. `law`: the light at a normal in its axes.
  template <class Law>
  Ball(const Law& law, std::span<const float, 9> rotation) {
    for (int p = 0; p < kSize * kSize; ++p) {
      const double x = (p % kSize - 15.5) / 15, y = -(p / kSize - 15.5) / 15,
                   rest = 1 - x * x - y * y;
      if (rest > 0) Fill(static_cast<std::size_t>(p), {x, y, std::sqrt(rest)}, law, rotation);
    }
  }
  LightEvidence<double> evidence() const { return {texture, normals, picture, cover}; }

 private:
  template <class Law>
  void Fill(std::size_t p, const std::array<double, 3>& n, const Law& law,
            std::span<const float, 9> r) {
    const double lit = law(n);
    cover[p] = 1;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = c * kPixels + p;
      texture[at] = 0.5 + 0.4 * std::sin(5 * n[0] + 3 * static_cast<double>(c));
      picture[at] = std::min(1.0, lit * texture[at]);
      normals[at] = double{r[c]} * n[0] + double{r[3 + c]} * n[1] + double{r[6 + c]} * n[2];
    }
  }
};

LightConfig Light(double spread, double ambient) {
  LightConfig config;
  config.spread = spread;
  config.ambient = ambient;
  return config;
}

auto Lambert(const Direction& light, double ambient) {
  return [=](const std::array<double, 3>& n) {
    return ambient + std::max(0.0, n[0] * double{light[0]} + n[1] * double{light[1]} +
                                       n[2] * double{light[2]});
  };
}

// Some of all lights within 1.5 radians of the camera's axis.
Direction LightAt(int k, int count) {
  const double tilt = 1.5 * (k + 0.5) / count, turn = 2.4 * k;
  return {static_cast<float>(std::sin(tilt) * std::cos(turn)),
          static_cast<float>(std::sin(tilt) * std::sin(turn)), static_cast<float>(std::cos(tilt))};
}

Direction AsFloat(const std::array<double, 3>& d) {
  return {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])};
}

// Lattice and rings leave some 1.5 degrees, the ball's pixels another; at the edge of the
// hemisphere a third of the ball's outline is all that is lit.
TEST(LightSearch, FindsTheLight) {
  const Camera camera = OrbitCamera<float>({}, 70, 25, 1.6);
  for (const double ambient : {0.0, 0.2}) {
    const LightSearch search(Light(90, ambient));
    for (int k = 0; k < 24; ++k) {
      const Direction light = LightAt(k, 24);
      const Ball ball(Lambert(light, ambient), camera.rotation);
      const Direction found = AsFloat(search.Find(ball.evidence(), camera.rotation).direction);
      EXPECT_LT(AngleBetween(found, light), 3) << "light " << k << ", ambient " << ambient;
    }
  }
}

// A direction that is 2 degrees off moves the sky, too.
TEST(LightSearch, FindsSkyAndDirectionOfHarmonics) {
  const Camera camera = OrbitCamera<float>({}, -40, 10, 1.6);
  LightConfig config;
  config.model = "harmonics";
  const LightSearch search(config);
  for (int k = 0; k < 12; ++k) {
    const Direction light = LightAt(k, 12);
    const double sky = config.sky_low + (config.sky_high - config.sky_low) * k / 11;
    const std::array<float, 9> sh = SkyAndLight(sky, light);
    const auto law = [&](const std::array<double, 3>& n) {
      const std::array<double, 9> basis = HarmonicBasis(n);
      double lit = 0;
      for (std::size_t i = 0; i < 9; ++i) lit += double{sh[i]} * basis[i];
      return lit;
    };
    const Ball ball(law, camera.rotation);
    const FoundLight found = search.Find(ball.evidence(), camera.rotation);
    EXPECT_LT(AngleBetween(AsFloat(found.direction), light), 4) << "light " << k;
    EXPECT_NEAR(found.sky, sky, 0.02) << "light " << k;
  }
}

TEST(LightSearch, StaysInItsCapAndSaysNothingOfNothing) {
  const Camera camera = OrbitCamera<float>({}, 0, 0, 1.6);
  const LightSearch search(Light(30, 0));
  Ball ball(Lambert({0.8f, 0, 0.6f}, 0), camera.rotation);
  EXPECT_GE(search.Find(ball.evidence(), camera.rotation).direction[2], std::cos(0.5236) - 1e-6);
  std::fill(ball.cover.begin(), ball.cover.end(), 0.0);
  EXPECT_EQ(search.Find(ball.evidence(), camera.rotation).direction, (std::array<double, 3>{}));
}

}  // namespace tilegrad::train::task_test
