// SPDX-License-Identifier: Apache-2.0
// Portions of a step side by side: the bits of a run depend on their number, never on how many
// workers share them or when the run was stopped.
#include <gtest/gtest.h>

#include "data/photographs/miniature.h"
#include "nn/nn.h"
#include "same_run.h"
#include "support/temp_folder.h"
#include "tiny_run.h"
#include "train/trainer.h"

namespace tilegrad::train::portions_test {

constexpr int kSteps = 7, kStop = 4;

struct Kind {
  const char* name;
  std::string config;
  std::vector<std::string> settings = {};
  const char* data = "data";
};

void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

const std::vector<std::string> kCritic = {
    "adversarial.weight=0.5",     "adversarial.features=1",        "adversarial.base=4",
    "adversarial.halvings=2",     "adversarial.updates=2",         "adversarial.learning_rate=1e-3",
    "adversarial.perceptual=0.1", "adversarial.place=interpolates"};

const Kind kKinds[] = {
    {"single", kTinyConfig + "[stream]\nshare = 0.5\n", {"schedule.mirrored=0.5"}},
    {"softras", kTinyConfig, {"render.rule=softras", "softras.color=true"}},
    {"textured", kTinyTextured},
    {"critic", kTinyTextured, kCritic},
    {"classify", kTinyClassifier, {"schedule.mirrored=0.5"}},
    {"gan", kTinyGan, {"schedule.batch=8", "stages.shape=3", "critic.texture_weight=0.5"}},
    {"photographs", kTinyPhotographs, {}, "cub"},
    {"photographs_critic",
     kTinyPhotographs,
     {"adversarial.weight=0.5", "adversarial.base=4", "adversarial.halvings=2"},
     "cub"},
};

class Portions : public TempFolderTest, public testing::WithParamInterface<Kind> {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_ / "data");
    Ok(WriteNoiseDataset(folder_ / "data", Meshes::kBoxes, 2));
    if (std::string_view(GetParam().data) == "cub") WriteMiniature(folder_ / "cub", "cub");
    settings_ = GetParam().settings;
    const std::string_view name = GetParam().name;
    if (name == "gan") NeedRun("textures", kTinyTextured, "textures.run=");
    if (name == "critic") NeedRun("classifier", kTinyClassifier, "adversarial.network_file=");
  }

  // A run that the configuration names.
  void NeedRun(const std::string& run, const std::string& config, const std::string& key) {
    const std::vector<std::string> own = {"schedule.steps=2"};
    TrainJob job = JobOf(run, config, own);
    job.data = folder_ / "data";
    ASSERT_TRUE(Train(job, Workers(1), {}).ok());
    settings_.push_back(key + (folder_ / run).string());
  }

  TrainJob JobOf(const std::string& run, const std::string& config,
                 const std::vector<std::string>& settings) {
    TrainJob job;
    job.config = ParseConfig(config, "tiny").value();
    Ok(OverrideFields(settings, job.config.Fields()));
    job.data = folder_ / GetParam().data;
    job.run = folder_ / run;
    job.existing = ExistingRun::kContinue;
    return job;
  }

  struct How {
    std::string run;
    int portions, workers, stop = kSteps + 1;  // stop: after so many steps
  };
  void Run(const How& how) {
    std::vector<std::string> settings = settings_;
    settings.push_back("schedule.portions=" + std::to_string(how.portions));
    settings.push_back("schedule.steps=" + std::to_string(kSteps));
    const TrainJob job = JobOf(how.run, GetParam().config, settings);
    StopFlag stop = false;
    const auto stop_after = [&](const Progress& p) {
      if (p.stage == "training" && p.done >= static_cast<std::size_t>(how.stop)) stop = true;
    };
    const auto outcome = Train(job, Workers(how.workers), {stop_after, &stop});
    const bool whole = how.stop > kSteps;
    EXPECT_EQ(outcome.ok(), whole) << outcome.status().message();
  }
  void ExpectSame(const std::string& a, const std::string& b) {
    ExpectSameBits(context_, folder_ / a, folder_ / b, kSteps);
    ExpectSameCurves(folder_ / a, folder_ / b, kSteps);
  }

  Workers workers_{1};
  nn::Context context_{workers_};
  std::vector<std::string> settings_;
};

TEST_P(Portions, HaveTheSameBitsOnAnyNumberOfWorkersAndResume) {
  for (const int portions : {1, 2, 4}) {
    SCOPED_TRACE(portions);
    const std::string name = std::to_string(portions) + "_";
    Run({name + "1", portions, 1});
    for (const int workers : {2, 3, 16}) {
      const std::string run = name + std::to_string(workers);
      Run({run, portions, workers});
      ExpectSame(name + "1", run);
    }
    const std::string stopped = name + "stopped";
    Run({stopped, portions, 16, kStop});
    Run({stopped, portions, 2});
    ExpectSame(name + "1", stopped);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Portions, testing::ValuesIn(kKinds),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace tilegrad::train::portions_test
