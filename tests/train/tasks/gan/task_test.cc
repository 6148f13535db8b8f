// SPDX-License-Identifier: Apache-2.0
// The task goes the whole way on a small dataset: textures are extracted, shapes and then textures
// are trained, it is stopped and continues to the same bits, and makes meshes from noise.
#include <gtest/gtest.h>

#include <cstring>

#include "support/temp_folder.h"
#include "train/predictor.h"
#include "train/report/report.h"
#include "train/run/log.h"
#include "train/tasks/gan/model.h"
#include "train/tiny_run.h"
#include "train/trainer.h"

namespace tilegrad::train::gan_task_test {

const ProgressSink kSilent = [](const Progress&) {};

class GanTaskTest : public TempFolderTest {
 protected:
  GanTaskTest() : context_(workers_) {
    std::filesystem::create_directories(folder_ / "data");
    EXPECT_TRUE(WriteNoiseDataset(folder_ / "data", Meshes::kBoxes).ok());
  }
  void TrainTextures() {
    auto config = Ok(ParseConfig(kTinyTextured, "tiny.toml"));
    ValueOf<std::int64_t>(*config, "schedule.steps") = 2;
    TrainJob job;
    job.config = std::move(*config);
    job.data = folder_ / "data";
    job.run = folder_ / "textured";
    const auto outcome = Ok(Train(job, workers_, kSilent, stop_));
  }
  struct Job {
    std::string run;
    std::vector<std::string> settings = {};
    int workers = 2;
    std::size_t stop_at = 1000;  // steps
  };
  Result<RunOutcome> TrainGan(const Job& at) const {
    TrainJob job;
    TILEGRAD_ASSIGN(job.config, ParseConfig(kTinyGan, "gan.toml"));
    std::vector<std::string> settings = {"textures.run=" + (folder_ / "textured").string()};
    settings.insert(settings.end(), at.settings.begin(), at.settings.end());
    TILEGRAD_TRY(OverrideFields(settings, job.config.Fields()));
    job.data = folder_ / "data";
    job.run = folder_ / at.run;
    job.existing = ExistingRun::kContinue;
    StopFlag stop = false;
    const ProgressSink watch = [&](const Progress& progress) {
      if (progress.stage == "training" && progress.done >= at.stop_at) stop = true;
    };
    return Train(job, Workers(at.workers), watch, stop);
  }
  std::vector<nn::NamedTensor> Final(const std::string& run) {
    auto found = Ok(LoadNewestCheckpoint(context_, folder_ / run));
    if (!found.ok()) return {};
    EXPECT_EQ(found->checkpoint.info.step, 12);
    return std::move(found->checkpoint.tensors);
  }

  Workers workers_{2};
  nn::Context context_;
  StopFlag stop_ = false;
};

void ExpectSameBits(const std::vector<nn::NamedTensor>& a, const std::vector<nn::NamedTensor>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].name, b[i].name);
    ASSERT_EQ(a[i].value.bytes(), b[i].value.bytes());
    EXPECT_EQ(std::memcmp(a[i].value.raw(), b[i].value.raw(), a[i].value.bytes()), 0) << a[i].name;
  }
}

TEST_F(GanTaskTest, StoppedInEachStageAndContinuedEndsInTheSameBits) {
  ASSERT_NO_FATAL_FAILURE(TrainTextures());
  const auto whole = Ok(TrainGan({"whole"}));
  const auto first = TrainGan({.run = "stopped", .workers = 1, .stop_at = 4});
  EXPECT_EQ(first.status().code(), StatusCode::kCancelled) << first.status().message();
  const auto second = TrainGan({.run = "stopped", .workers = 2, .stop_at = 9});
  EXPECT_EQ(second.status().code(), StatusCode::kCancelled) << second.status().message();
  const auto continued = Ok(TrainGan({.run = "stopped", .workers = 1}));
  EXPECT_GE(continued->first_step, 9);
  ExpectSameBits(Final("whole"), Final("stopped"));
  const auto a = ReadLog(folder_ / "whole"), b = ReadLog(folder_ / "stopped");
  ASSERT_TRUE(a.ok() && b.ok());
  ASSERT_EQ(a->size(), b->size());
  for (std::size_t i = 0; i < a->size(); ++i)
    EXPECT_EQ(a->at(i).values[0], b->at(i).values[0]) << "loss of step " << i;
}

TEST_F(GanTaskTest, SampleSheetsLeaveTheBitsAlone) {
  ASSERT_NO_FATAL_FAILURE(TrainTextures());
  ASSERT_TRUE(TrainGan({"few"}).ok());
  ASSERT_TRUE(TrainGan({.run = "many", .settings = {"schedule.sample_every=1"}}).ok());
  EXPECT_TRUE(std::filesystem::exists(folder_ / "few/samples/step_00000010.png"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "many/samples/step_00000001.png"));
  ExpectSameBits(Final("few"), Final("many"));
}

TEST_F(GanTaskTest, ShapesLearnFirstAndThenStay) {
  ASSERT_NO_FATAL_FAILURE(TrainTextures());
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
  ASSERT_NO_FATAL_FAILURE(TrainTextures());
  ASSERT_TRUE(TrainGan({.run = "shape", .settings = {"schedule.steps=6"}}).ok());
  const auto second =
      TrainGan({.run = "second",
                .settings = {"stages.shape=0", "start.run=" + (folder_ / "shape").string(),
                             "critic.texture_weight=0"}});
  ASSERT_TRUE(second.ok()) << second.status().message();
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
  ASSERT_NO_FATAL_FAILURE(TrainTextures());
  ASSERT_TRUE(TrainGan({"run"}).ok());
  const Path run = folder_ / "run";
  EXPECT_TRUE(std::filesystem::exists(run / "samples" / "step_00000012.png"));
  std::vector<std::vector<Mesh>> made;
  for (const int count : {1, 2}) {
    const Workers workers(count);
    const auto predictor = Ok(Predictor::Load(run, workers));
    auto& model = *predictor->model().generator();
    EXPECT_TRUE(model.textured());
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

  const ReportJob page{run, folder_ / "data", folder_ / "page.html", 2};
  const auto report = Ok(WriteReport(page, workers_, kSilent, stop_));
  const std::string text = ReadText(page.out).value();
  for (const char* part :
       {"to make textured objects from noise", "Wasserstein estimate", "sample 1 from behind",
        "Generated meshes to turn", "tilegrad sample --score --run"})
    EXPECT_NE(text.find(part), std::string::npos) << part;
  for (const char* part : {"Held-out models", "has not been evaluated", "unnamed creator"})
    EXPECT_EQ(text.find(part), std::string::npos) << part;
}

TEST_F(GanTaskTest, WhatCannotBeIsAnError) {
  ASSERT_NO_FATAL_FAILURE(TrainTextures());
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

}  // namespace tilegrad::train::gan_task_test
