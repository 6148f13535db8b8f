// SPDX-License-Identifier: Apache-2.0
// The task goes the whole way on a small dataset: it trains, predicts textured meshes, is evaluated
// by Table 2 and reported.
#include <gtest/gtest.h>

#include "support/temp_folder.h"
#include "train/predictor.h"
#include "train/report/report.h"
#include "train/run/log.h"
#include "train/tasks/textured_image/model.h"
#include "train/tiny_run.h"
#include "train/trainer.h"

namespace tilegrad::train {
namespace {

const ProgressSink kSilent = [](const Progress&) {};

class TexturedTask : public TempFolderTest {
 protected:
  TexturedTask() {
    std::filesystem::create_directories(folder_ / "data");
    EXPECT_TRUE(WriteNoiseDataset(folder_ / "data", Meshes::kBoxes).ok());
  }
  void Train(const std::string& more) {
    TrainJob job;
    auto config = ParseConfig(std::string(kTinyTextured) + more, "tiny.toml");
    ASSERT_TRUE(config.ok()) << config.status().message();
    job.config = std::move(*config);
    ValueOf<std::int64_t>(job.config, "schedule.steps") = 12;
    job.data = folder_ / "data", job.run = folder_ / "run";
    const auto outcome = train::Train(job, workers_, kSilent, stop_);
    ASSERT_TRUE(outcome.ok()) << outcome.status().message();
    EXPECT_TRUE(outcome->finished);
  }

  Workers workers_{2};
  StopFlag stop_ = false;
};

TEST_F(TexturedTask, TrainsPredictsIsEvaluatedAndReported) {
  ASSERT_NO_FATAL_FAILURE(Train(""));
  const Path run = folder_ / "run", data = folder_ / "data";
  EXPECT_TRUE(std::filesystem::exists(run / "stream.png"));
  EXPECT_TRUE(std::filesystem::exists(run / "samples" / "step_00000010.png"));
  const auto predictor = Predictor::Load(run, workers_);
  ASSERT_TRUE(predictor.ok()) << predictor.status().message();
  const auto meshes = predictor->Predict(std::vector<std::uint8_t>(4 * 32 * 32, 128));
  ASSERT_TRUE(meshes.ok()) << meshes.status().message();
  ASSERT_EQ((*meshes)[0].textures.size(), 1u);
  EXPECT_EQ((*meshes)[0].textures[0].image.width, 64);
  EXPECT_EQ((*meshes)[0].corner_uvs.size(), 3 * (*meshes)[0].faces.size());

  const TaskEvaluation job{.run = run, .data = data, .predictor = *predictor, .views_per_model = 3};
  const auto evaluation = predictor->task().Evaluate(job, workers_, kSilent, stop_);
  ASSERT_TRUE(evaluation.ok()) << evaluation.status().message();
  ASSERT_EQ(evaluation->rows.size(), 3u);
  const Score &dark = evaluation->rows[0].mean, &mean = evaluation->rows[1].mean,
              &ours = evaluation->rows[2].mean;
  EXPECT_FALSE(dark.light_angle);
  EXPECT_GT(*mean.light_angle, 5);
  EXPECT_EQ(*dark.texture_l1, *ours.texture_l1);
  EXPECT_GT(*dark.lit_l1, *ours.lit_l1);  // lit pictures are darker than textures
  EXPECT_NE(FormatTable(*evaluation).find("texture + light L1"), std::string::npos);
  ASSERT_TRUE(WriteEvaluation(run, *evaluation).ok());
  const auto read = ReadEvaluation(run);
  ASSERT_TRUE(read.ok() && read->has_value());
  EXPECT_EQ((*read)->rows[2].mean.light_angle, ours.light_angle);

  const ReportJob page{run, data, folder_ / "page.html", 2};
  const auto report = WriteReport(page, workers_, kSilent, stop_);
  ASSERT_TRUE(report.ok()) << report.status().message();
  const std::string text = ReadText(page.out).value();
  for (const char* part : {"to predict shape, texture and light", "texture + light L1",
                           "true light", "another view", "Angle of the light"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part;
  }
}

TEST_F(TexturedTask, WithoutLightThereIsNoLightToScore) {
  ASSERT_NO_FATAL_FAILURE(Train("[light]\nmodel = \"none\"\n"));
  const auto predictor = Predictor::Load(folder_ / "run", workers_);
  ASSERT_TRUE(predictor.ok()) << predictor.status().message();
  const TaskEvaluation job{.run = folder_ / "run",
                           .data = folder_ / "data",
                           .predictor = *predictor,
                           .views_per_model = 2};
  const auto evaluation = predictor->task().Evaluate(job, workers_, kSilent, stop_);
  ASSERT_TRUE(evaluation.ok()) << evaluation.status().message();
  ASSERT_EQ(evaluation->rows.size(), 1u);
  EXPECT_FALSE(evaluation->rows[0].mean.light_angle);
}

// The files of configs/ name keys that there are, and sizes that go with their images.
TEST(TexturedConfigs, AreRead) {
  for (const auto& [file, size] : {std::pair("texture_quick", 64), {"texture_paper", 256}}) {
    const Path path = Path(TILEGRAD_SOURCE_DIR) / "configs" / (std::string(file) + ".toml");
    const auto config = ParseConfig(ReadText(path).value(), path.string());
    ASSERT_TRUE(config.ok()) << config.status().message();
    EXPECT_EQ(config->name, file);
    auto copy = ParseConfig(WriteConfig(*config), "its own text");
    ASSERT_TRUE(copy.ok()) << copy.status().message();
    const std::int64_t levels = ValueOf<std::int64_t>(*copy, "network.levels");
    EXPECT_TRUE(CheckImageSize({.levels = levels}, size).ok());
  }
}

TEST_F(TexturedTask, WordsThatAreNotKnownAreErrors) {
  TrainJob job;
  job.config = ParseConfig(std::string(kTinyTextured) + "[light]\nmodel = \"neon\"\n", "t").value();
  job.data = folder_ / "data", job.run = folder_ / "run";
  ExpectMessage(train::Train(job, workers_, kSilent, stop_).status(), "light.model is \"neon\"");
}

}  // namespace
}  // namespace tilegrad::train
