// SPDX-License-Identifier: Apache-2.0
// What holds for runs of every task: the bits of a run depend on its settings and on the number of
// portions of a step, never on how many workers share them, when the run was stopped or how often
// it was looked at.
#include <gtest/gtest.h>

#include <functional>

#include "data/photographs/miniature.h"
#include "nn/nn.h"
#include "same_run.h"
#include "tiny_run_fixture.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train::every_task_test {

constexpr int kSteps = 7, kStop = 4, kNever = 1000;

std::vector<std::string> PerceptualCritic() {
  std::vector<std::string> settings = kTinyCritic;
  settings.push_back("adversarial.perceptual=0.1");
  return settings;
}

const TinyKind kKinds[] = {
    {"single", kTinyConfig + "[stream]\nshare = 0.5\n", {"schedule.mirrored=0.5"}},
    // With everything that is off by default.
    {"options",
     kTinyConfig,
     {"schedule.mirrored=0.5", "optimizer.average=0.9", "network.smoothing=2",
      "network.symmetric=true", "network.fc_norm=false", "network.picture_colors=true"}},
    {"softras", kTinyConfig, {"render.rule=softras", "softras.color=true"}},
    {"textured", kTinyTextured},
    {"critic", kTinyTextured, PerceptualCritic()},
    {"classify", kTinyClassifier, {"schedule.mirrored=0.5"}},
    {"gan", kTinyGan, {"schedule.batch=8", "stages.shape=3", "critic.texture_weight=0.5"}},
    {"photographs", kTinyPhotographs, {}, "cub"},
    {"photographs_critic",
     kTinyPhotographs,
     {"adversarial.weight=0.5", "adversarial.features=1", "adversarial.base=4",
      "adversarial.halvings=2", "adversarial.learning_rate=1e-3"},
     "cub"},
};

class EveryTask : public TinyRunTest, public testing::WithParamInterface<TinyKind> {
 protected:
  void SetUp() override {
    Ok(WriteNoiseDataset(folder_ / "data", Meshes::kBoxes, 2));
    if (std::string_view(GetParam().data) == "cub") WriteMiniature(folder_ / "cub", "cub");
    settings_ = GetParam().settings;
    const std::string_view name = GetParam().name;
    if (name == "gan") NeedRun("textures", kTinyTextured, "textures.run=");
    if (name == "critic") NeedRun("classifier", kTinyClassifier, "adversarial.network_file=");
  }

  // A run that the configuration names.
  void NeedRun(const std::string& run, const std::string& config, const std::string& key) {
    const TinyRun tiny{.run = run, .config = config, .settings = {"schedule.steps=2"}};
    Ok(Train(tiny).status());
    settings_.push_back(key + (folder_ / run).string());
  }

  struct How {
    std::string run;
    int portions = 1, workers = 2, stop = kNever;  // stop: after so many steps
    int steps = kSteps, sample_every = 10;
    std::function<void(const Path&)> drawn = {};
  };
  void Run(const How& how) {
    std::vector<std::string> settings = settings_;
    settings.push_back("schedule.portions=" + std::to_string(how.portions));
    settings.push_back("schedule.steps=" + std::to_string(how.steps));
    settings.push_back("schedule.sample_every=" + std::to_string(how.sample_every));
    const auto outcome = Train({.run = how.run,
                                .config = GetParam().config,
                                .settings = settings,
                                .data = GetParam().data,
                                .workers = how.workers,
                                .stop_at = static_cast<std::size_t>(how.stop),
                                .drawn = how.drawn});
    EXPECT_EQ(outcome.ok(), how.stop == kNever) << outcome.status().message();
  }
  void ExpectSame(const std::string& a, const std::string& b, int steps = kSteps) {
    ExpectSameBits(context_, folder_ / a, folder_ / b, steps);
    ExpectSameCurves(folder_ / a, folder_ / b, steps);
  }

  nn::Context context_{workers_};
  std::vector<std::string> settings_;
};

TEST_P(EveryTask, HasTheSameBitsOnAnyNumberOfWorkersAndResumes) {
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
    Run({stopped, portions, 16, kStop});  // between two checkpoints of the schedule
    EXPECT_EQ(LoadNewestCheckpoint(context_, folder_ / stopped)->checkpoint.info.step, kStop);
    Run({stopped, portions, 2});
    ExpectSame(name + "1", stopped);
  }
}

// Whoever looks more often gets the same weights.
TEST_P(EveryTask, SampleSheetsComeEarlyAndLeaveTheBitsAlone) {
  constexpr int kSheetSteps = 12;
  for (const int every : {1, 1000}) {
    std::vector<std::string> drawn;
    const auto note = [&](const Path& file) {
      EXPECT_TRUE(std::filesystem::exists(file)) << file;
      drawn.push_back(file.filename().string());
    };
    Run({.run = std::to_string(every), .steps = kSheetSteps, .sample_every = every, .drawn = note});
    const std::vector<std::string> few = {"step_00000010.png", "step_00000012.png"};
    if (every == 1)
      EXPECT_EQ(drawn.size(), static_cast<std::size_t>(kSheetSteps));
    else
      EXPECT_EQ(drawn, few);
  }
  ExpectSame("1", "1000", kSheetSteps);
  if (GetParam().config.find("[stream]") != std::string::npos) {
    EXPECT_TRUE(std::filesystem::exists(folder_ / "1" / "stream.png"));
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryTask, testing::ValuesIn(kKinds),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace tilegrad::train::every_task_test
