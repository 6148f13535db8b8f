// SPDX-License-Identifier: Apache-2.0
// The real program is killed with SIGKILL at random moments and resumed: the weights, moments and
// curves are those of a run that nobody disturbed, bit for bit, whatever the number of workers.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "base/rng.h"
#include "nn/nn.h"
#include "support/temp_folder.h"
#include "train/checkpoint.h"
#include "train/data/dataset_files.h"
#include "train/run_log.h"

namespace tilegrad::train {
namespace {

using Seconds = std::chrono::duration<double>;
using Clock = std::chrono::steady_clock;

constexpr const char* kConfig = R"(name = "tiny"
[network]
channels = 4
code = 16
hidden1 = 16
hidden2 = 16
template_level = 1
fc_deviation = 0.0
[render]
sharpness = 500
sharpness_start = 100
[schedule]
batch = 8
views = 2
log_every = 1
sample_every = 10
checkpoint_every = 3
keep_checkpoints = 2
)";

// Images of noise: what they show does not matter here.
Status WriteNoiseDataset(const Path& folder) {
  constexpr int kModels = 12, kSize = 32, kViews = 4;
  DatasetInfo info;
  info.source = "nmr";
  info.image_size = info.camera.lens.width = info.camera.lens.height = kSize;
  info.views = kViews;
  info.classes = {"noise"};
  info.recipe = "0000000000000000";
  ModelData data;
  data.images.resize(std::size_t{kViews} * 4 * kSize * kSize);
  data.occupancy.resize(std::size_t{kOccupancyResolution} * kOccupancyResolution *
                        kOccupancyResolution);
  std::vector<ModelInfo> models;
  Rng rng(3);
  for (int m = 0; m < kModels; ++m) {
    ModelInfo model;
    model.id = model.name = "m" + std::to_string(m);
    model.split = m < 10 ? Split::kTrain : Split::kTest;
    for (std::uint8_t& byte : data.images) byte = static_cast<std::uint8_t>(rng.Below(256));
    const Path file = ModelFilePath(folder, "noise", model.id);
    std::filesystem::create_directories(file.parent_path());
    if (Status status = SaveModelFile(file, info, data, {info.recipe, 0, 0}); !status.ok()) {
      return status;
    }
    models.push_back(model);
  }
  if (Status status = WriteDatasetInfo(folder, info); !status.ok()) return status;
  return WriteModels(folder, info, models);
}

class KillResume : public TempFolderTest {
 protected:
  KillResume() : workers_(1), context_(workers_) {
    Write("tiny.toml", std::string(kConfig));
    std::filesystem::create_directories(folder_ / "data");
    const Status written = WriteNoiseDataset(folder_ / "data");
    EXPECT_TRUE(written.ok()) << written.message();
  }

  // Starts `tilegrad train` with the run folder `run`; what it prints is appended to <run>.txt.
  pid_t Start(const std::string& run, int workers) const {
    const std::vector<std::string> words = {
        TILEGRAD_PROGRAM, "train",
        "--config",       (folder_ / "tiny.toml").string(),
        "--data",         (folder_ / "data").string(),
        "--out",          (folder_ / run).string(),
        "--workers",      std::to_string(workers),
        "--set",          "schedule.steps=" + std::to_string(steps_),
        "--resume"};
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    const std::string log = (folder_ / (run + ".txt")).string();
    const pid_t child = ::fork();
    if (child != 0) return child;
    if (std::freopen(log.c_str(), "a", stdout) == nullptr || ::dup2(1, 2) < 0) ::_exit(126);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }

  static int Wait(pid_t child) {
    int status = 0;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    return status;
  }

  std::string Output(const std::string& run) const {
    return ReadText(folder_ / (run + ".txt")).value();
  }

  // Runs to the end; the seconds it took.
  double Finish(const std::string& run, int workers) {
    const auto start = Clock::now();
    const int status = Wait(Start(run, workers));
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << Output(run);
    return Seconds(Clock::now() - start).count();
  }

  // Kills the run after a random time, `kills` times, early enough that it is never complete.
  int KillAtRandom(const std::string& run, int kills, double seconds) {
    Rng rng(static_cast<std::uint64_t>(kills));
    int killed = 0;
    for (int k = 0; k < kills; ++k) {
      const pid_t child = Start(run, 1 + k % 2);
      std::this_thread::sleep_for(Seconds(rng.Uniform(0, seconds / kills)));
      ::kill(child, SIGKILL);
      killed += WIFSIGNALED(Wait(child)) ? 1 : 0;
    }
    return killed;
  }

  std::vector<nn::NamedTensor> Final(const std::string& run) {
    auto found = LoadNewestCheckpoint(context_, folder_ / run);
    EXPECT_TRUE(found.ok()) << found.status().message();
    if (!found.ok()) return {};
    EXPECT_EQ(found->checkpoint.info.step, steps_);
    return std::move(found->checkpoint.tensors);
  }

  void ExpectSameBits(const std::string& a, const std::string& b) {
    const auto left = Final(a), right = Final(b);
    ASSERT_FALSE(left.empty());
    ASSERT_EQ(left.size(), right.size());
    for (std::size_t i = 0; i < left.size(); ++i) {
      ASSERT_EQ(left[i].name, right[i].name);
      ASSERT_EQ(left[i].value.bytes(), right[i].value.bytes());
      EXPECT_EQ(std::memcmp(left[i].value.raw(), right[i].value.raw(), left[i].value.bytes()), 0)
          << left[i].name;
    }
  }

  // Every step once, in order, with the same losses. Rates and times are of the clock.
  void ExpectSameCurves(const std::string& a, const std::string& b) {
    const auto left = ReadLog(folder_ / a), right = ReadLog(folder_ / b);
    ASSERT_TRUE(left.ok() && right.ok());
    ASSERT_EQ(left->size(), static_cast<std::size_t>(steps_));
    ASSERT_EQ(right->size(), left->size());
    for (std::size_t i = 0; i < left->size(); ++i) {
      EXPECT_EQ(left->at(i).step, static_cast<std::int64_t>(i) + 1);
      EXPECT_EQ(right->at(i).step, left->at(i).step);
      for (std::size_t k = 0; k < left->at(i).values.size(); ++k) {
        const auto& [name, value] = left->at(i).values[k];
        if (name == "images_per_second" || name == "seconds") continue;
        EXPECT_EQ(right->at(i).values[k].first, name);
        EXPECT_EQ(right->at(i).values[k].second, value) << name << " of step " << i + 1;
      }
    }
  }

  void CheckKills(int kills) {
    const double seconds = Finish("whole", 2);
    EXPECT_GT(KillAtRandom("killed", kills, seconds), 0);
    Finish("killed", 1);
    ExpectSameBits("whole", "killed");
    ExpectSameCurves("whole", "killed");
  }

  Workers workers_;
  nn::Context context_;
  int steps_ = 40;
};

TEST_F(KillResume, ThreeKills) { CheckKills(3); }

TEST_F(KillResume, LongTenKills) {
  steps_ = 300;
  CheckKills(10);
}

TEST_F(KillResume, TerminationSavesAndSaysHowToGoOn) {
  steps_ = 100000;
  const pid_t child = Start("run", 1);
  const Path log = folder_ / "run" / "metrics.jsonl";
  const auto first_step_logged = [&] {
    std::error_code error;
    const auto size = std::filesystem::file_size(log, error);
    return !error && size > 0;
  };
  for (int i = 0; i < 6000 && !first_step_logged(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ::kill(child, SIGTERM);
  const int status = Wait(child);
  ASSERT_TRUE(WIFEXITED(status)) << Output("run");
  EXPECT_EQ(WEXITSTATUS(status), 130) << Output("run");
  EXPECT_NE(Output("run").find("--resume"), std::string::npos) << Output("run");
  const auto found = LoadNewestCheckpoint(context_, folder_ / "run");
  ASSERT_TRUE(found.ok()) << found.status().message();
  const auto curve = ReadLog(folder_ / "run");
  ASSERT_TRUE(curve.ok());
  ASSERT_FALSE(curve->empty());
  EXPECT_EQ(found->checkpoint.info.step, curve->back().step);  // nothing that was done is lost
}

}  // namespace
}  // namespace tilegrad::train
