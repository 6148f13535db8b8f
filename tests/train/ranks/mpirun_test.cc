// SPDX-License-Identifier: Apache-2.0
// The real program under mpirun: the same bits on any number of ranks, a rank that is killed, and
// ranks that must not work together.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "../data/photographs/miniature.h"
#include "../same_run.h"
#include "../tiny_run.h"
#include "base/sanitizers.h"
#include "base/simd_target.h"
#include "nn/nn.h"
#include "support/process.h"
#include "support/temp_folder.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train::mpirun_test {

using Clock = std::chrono::steady_clock;
using Words = std::vector<std::string>;

constexpr const char* kWithoutMpi = "SKIPPED: built without MPI (libopenmpi-dev or libmpich-dev)";

struct Ended {
  int code = -1;  // negative: the signal that ended it
  std::string output;
};

// Its textures come from the run "textures", and its second stage begins at a step that no
// checkpoint of the first 200 but one falls on.
const TinyKind kGan = {"gan", kTinyGan, {"schedule.batch=8", "stages.shape=9"}};

const TinyKind kKinds[] = {
    {"single", kTinyConfig + "[stream]\nshare = 0.5\n", {}},
    {"textured", kTinyTextured},
    {"critic", kTinyTextured, kTinyCritic},
    {"classify", kTinyClassifier},
    kGan,
    {"photographs", kTinyPhotographs, {}, "cub"},
};

class Ranks : public TempFolderTest {
 protected:
  Ranks() : workers_(1), context_(workers_) {
    // As root in a container without ssh, with more ranks than cores.
    for (const char* name : {"OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM",
                             "OMPI_MCA_rmaps_base_oversubscribe"})
      ::setenv(name, "1", 1);
    ::setenv("OMPI_MCA_plm_rsh_agent", "", 1);
    ::setenv("OMPI_MCA_btl_vader_single_copy_mechanism", "none", 0);
    // Open MPI keeps what it allocates at start, and is unloaded before leaks are named.
    if (kAddressSanitizer) ::setenv("ASAN_OPTIONS", "detect_leaks=0", 0);
  }

  void SetUp() override {
    if (std::string(TILEGRAD_MPIRUN).empty()) {
      std::puts(kWithoutMpi);  // CTest looks for it; --gtest_brief keeps reasons to itself
      GTEST_SKIP() << kWithoutMpi;
    }
    for (const char* data : {"data", "other_data"}) {
      std::filesystem::create_directories(folder_ / data);
      Ok(WriteNoiseDataset(folder_ / data, Meshes::kBoxes, 2));
    }
    WriteMiniature(folder_ / "cub", "cub");
    Use(kKinds[0]);
  }

  void Use(const TinyKind& kind) {
    Write("tiny.toml", kind.config);
    settings_ = kind.settings;
    data_ = kind.data;
    if (std::string_view(kind.name) != kGan.name) return;
    if (!std::filesystem::exists(folder_ / "textures")) MakeTextures("textures", "schedule.seed=1");
    settings_.push_back("textures.run=" + (folder_ / "textures").string());
  }
  void MakeTextures(const std::string& run, const std::string& setting) const {
    Write("textures.toml", kTinyTextured);
    ExpectDone({TILEGRAD_PROGRAM, "train", "--config", (folder_ / "textures.toml").string(),
                "--data", (folder_ / "data").string(), "--out", (folder_ / run).string(), "--set",
                "schedule.steps=2", "--set", setting, "--threads", "1"});
  }

  Words TrainWords(const std::string& run, int workers) const {
    Words words = {TILEGRAD_PROGRAM, "train",
                   "--config",       (folder_ / "tiny.toml").string(),
                   "--data",         (folder_ / data_).string(),
                   "--out",          (folder_ / run).string(),
                   "--threads",      std::to_string(workers),
                   "--set",          "schedule.portions=4",
                   "--set",          "schedule.steps=" + std::to_string(steps_),
                   "--resume"};
    for (const std::string& setting : settings_) words.insert(words.end(), {"--set", setting});
    return words;
  }

  static Words OnRanks(int ranks, Words words) {
    words.insert(words.begin(), {TILEGRAD_MPIRUN, "-n", std::to_string(ranks)});
    return words;
  }

  // What it prints goes to a file of its own.
  pid_t Start(const Words& words, const std::string& log) const {
    std::filesystem::remove(folder_ / log);
    return StartProcess(words, folder_ / log);
  }
  Ended End(pid_t child, const std::string& log) const {
    const int code = EndProcess(child);
    return {code, ReadText(folder_ / log).value()};
  }
  Ended Do(const Words& words) const { return End(Start(words, "log.txt"), "log.txt"); }
  void ExpectDone(const Words& words) const {
    const Ended ended = Do(words);
    ASSERT_EQ(ended.code, 0) << ended.output;
  }

  // One rank: without mpirun.
  void TrainOn(int ranks, int workers, const std::string& run) const {
    const Words words = TrainWords(run, workers);
    ExpectDone(ranks == 1 ? words : OnRanks(ranks, words));
  }

  void ExpectSame(const std::string& a, const std::string& b) {
    ExpectSameBits(context_, folder_ / a, folder_ / b, steps_);
    ExpectSameCurves(folder_ / a, folder_ / b, steps_);
  }

  void CheckSameBits(const std::vector<std::pair<int, int>>& ranks_and_workers) {
    for (const TinyKind& kind : kKinds) {
      SCOPED_TRACE(kind.name);
      Use(kind);
      const std::string whole = std::string(kind.name) + "_whole";
      ASSERT_NO_FATAL_FAILURE(TrainOn(1, 1, whole));
      for (const auto& [ranks, workers] : ranks_and_workers) {
        const std::string run = fmt::format("{}_{}_{}", kind.name, ranks, workers);
        ASSERT_NO_FATAL_FAILURE(TrainOn(ranks, workers, run));
        ExpectSame(whole, run);
        std::filesystem::remove_all(folder_ / run);
      }
    }
  }

  // Of mpirun: its ranks, in the order it started them.
  static std::vector<pid_t> ChildrenOf(pid_t parent) {
    std::vector<pid_t> out;
    std::error_code error;
    for (const auto& task :
         std::filesystem::directory_iterator(fmt::format("/proc/{}/task", parent), error)) {
      std::ifstream list(task.path() / "children");
      for (pid_t child; list >> child;) out.push_back(child);
    }
    return out;
  }

  // At once or soon. Where nobody reaps it, a process stays as a zombie.
  static bool IsGone(pid_t process) {
    for (int i = 0; i < 1000; ++i) {
      std::ifstream file(fmt::format("/proc/{}/stat", process));
      std::string number, name, state;
      if (!(file >> number >> name >> state) || state == "Z") return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }

  void AwaitStep(const std::string& run, std::int64_t step) const {
    for (int i = 0; i < 6000; ++i) {
      const auto log = ReadLog(folder_ / run);
      if (log.ok() && !log->empty() && log->back().step >= step) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }

  // Starts `ranks`, and kills one of them once a step is done.
  void KillOne(int ranks, std::size_t which, const std::string& run, std::int64_t step) const {
    const pid_t mpirun = Start(OnRanks(ranks, TrainWords(run, 1)), "killed.txt");
    AwaitStep(run, step);
    const std::vector<pid_t> children = ChildrenOf(mpirun);
    ASSERT_EQ(children.size(), static_cast<std::size_t>(ranks));
    const auto start = Clock::now();
    ::kill(children[which], SIGKILL);
    const Ended ended = End(mpirun, "killed.txt");
    EXPECT_LT(Clock::now() - start, std::chrono::seconds(10));
    EXPECT_NE(ended.code, 0);
    ExpectIn(ended.output, "signal 9");
    for (const pid_t child : children) EXPECT_TRUE(IsGone(child)) << "a rank lives on";
  }

  void CheckKills(const std::vector<std::int64_t>& steps) {
    ASSERT_NO_FATAL_FAILURE(TrainOn(1, 2, "whole"));
    int ranks = 2;
    for (const std::int64_t step : steps) {
      KillOne(ranks, static_cast<std::size_t>(step) % static_cast<std::size_t>(ranks), "killed",
              step);
      ranks = ranks % 4 + 1 == 1 ? 2 : ranks % 4 + 1;  // 2, 3, 4, 2, ..
    }
    ASSERT_NO_FATAL_FAILURE(TrainOn(ranks, 1, "killed"));
    ExpectSame("whole", "killed");
  }

  // That they end with this, said once.
  void ExpectRefused(const Words& words, int code, const std::string& message) const {
    const Ended ended = Do(words);
    EXPECT_EQ(ended.code, code) << ended.output;
    const std::size_t at = ended.output.find(message);
    ASSERT_NE(at, std::string::npos) << ended.output;
    EXPECT_EQ(ended.output.find(message, at + 1), std::string::npos) << ended.output;
    EXPECT_TRUE(ListCheckpoints(folder_ / "run").empty());
  }
  // Two ranks of which the second has other words, or stands behind them.
  Words Pair(const Words& first, const Words& second) const {
    Words words = OnRanks(1, first);
    words.insert(words.end(), {":", "-n", "1"});
    words.insert(words.end(), second.begin(), second.end());
    return words;
  }

  Workers workers_;
  nn::Context context_;
  int steps_ = 20;
  Words settings_;             // --set
  std::string data_ = "data";  // folder
};

TEST_F(Ranks, EveryTaskHasTheSameBitsOnAnyNumberOfThem) {
  CheckSameBits({{1, 2}, {2, 1}, {3, 1}, {4, 2}});
}

TEST_F(Ranks, LongSameBitsAfterTwoHundredSteps) {
  steps_ = 200;
  CheckSameBits({{1, 2}, {2, 1}, {2, 2}, {3, 1}, {3, 2}, {4, 1}, {4, 2}});
}

TEST_F(Ranks, AKilledOneEndsAllAndOthersGoOn) {
  steps_ = 60;
  CheckKills({1, 22});
}

TEST_F(Ranks, LongFiveKills) {
  steps_ = 400;
  CheckKills({1, 70, 137, 205, 298});
}

TEST_F(Ranks, LongFiveKillsInBothStagesOfAGame) {
  Use(kGan);
  settings_.push_back("stages.shape=100");
  steps_ = 200;
  CheckKills({1, 60, 99, 101, 160});
}

TEST_F(Ranks, OfAnotherDatasetAreRefused) {
  Words other = TrainWords("run", 1);
  *std::find(other.begin(), other.end(), (folder_ / "data").string()) =
      (folder_ / "other_data").string();
  const Path models = folder_ / "other_data" / "models" / "noise";
  std::filesystem::copy_file(models / "m2.npz", models / "m0.npz",
                             std::filesystem::copy_options::overwrite_existing);
  ExpectRefused(Pair(TrainWords("run", 1), other), 2, "has another dataset (");
}

// One name of a run, but another run: each rank has a working folder of its own.
TEST_F(Ranks, ThatExtractOtherTexturesAreRefused) {
  MakeTextures("textures", "schedule.seed=1");
  MakeTextures("elsewhere/textures", "schedule.seed=2");
  Use(kGan);
  settings_.back() = "textures.run=textures";
  Words first = TrainWords("run", 1), other = first;
  first.insert(first.begin(), {"/usr/bin/env", "-C", folder_.string()});
  other.insert(other.begin(), {"/usr/bin/env", "-C", (folder_ / "elsewhere").string()});
  ExpectRefused(Pair(first, other), 2, "has another dataset (");
}

TEST_F(Ranks, OfAnotherConfigurationAreRefused) {
  Words other = TrainWords("run", 1);
  other.insert(other.end(), {"--set", "optimizer.warmup=7"});
  ExpectRefused(Pair(TrainWords("run", 1), other), 2, "has another configuration (");
}

TEST_F(Ranks, OfAnotherInstructionSetAreRefused) {
  if (RunnableTargets().size() == 1) GTEST_SKIP() << "this build has one instruction set";
  Words other = TrainWords("run", 1);
  const std::string least = RunnableTargets().back();
  other.insert(other.begin(), {"/usr/bin/env", "TILEGRAD_TARGET=" + least});
  ExpectRefused(Pair(TrainWords("run", 1), other), 2,
                "has another instruction set (" + least + ")");
}

TEST_F(Ranks, AreAtMostAsManyAsPortions) {
  Words words = OnRanks(2, TrainWords("run", 1));
  words.insert(words.end(), {"--set", "schedule.portions=1"});
  ExpectRefused(words, 2, "2 ranks cannot share 1 portion of a batch");
}

TEST_F(Ranks, OfARunThatIsThereAreRefusedOnce) {
  steps_ = 1;
  ASSERT_NO_FATAL_FAILURE(TrainOn(1, 1, "there"));
  Words words = OnRanks(3, TrainWords("there", 1));
  words.erase(std::find(words.begin(), words.end(), "--resume"));
  ExpectRefused(words, 2, "already holds a run");
}

// All ranks meet gradients that are not finite in the middle of a step.
TEST_F(Ranks, AStepThatFailsIsSaidOnce) {
  Words words = OnRanks(3, TrainWords("run", 1));
  for (const char* setting :
       {"network.fc_norm=false", "network.fc_deviation=10", "network.output_deviation=10",
        "network.code=256", "network.hidden1=256", "network.hidden2=256", "loss.laplacian=1e12"})
    words.insert(words.end(), {"--set", setting});
  ExpectRefused(words, 1, "a smaller optimizer.learning_rate may help");
}

TEST_F(Ranks, MakeADatasetOfTheSameBytes) {
  const auto words = [&](const char* out) {
    return Words{TILEGRAD_PROGRAM, "dataset", "--source", "procedural",
                 "--limit",        "7",       "--size",   "32",
                 "--threads",      "1",       "--out",    (folder_ / out).string()};
  };
  ExpectDone(words("one"));
  const Ended ended = Do(OnRanks(3, words("three")));
  ASSERT_EQ(ended.code, 0) << ended.output;
  ExpectIn(ended.output, "(0 model files reused)");
  const auto files = Contents(folder_ / "one");
  EXPECT_GT(files.size(), 9u);
  EXPECT_TRUE(files == Contents(folder_ / "three"));
}

// Of each kind of evaluation, with more ranks than some have models.
TEST_F(Ranks, EvaluateToTheSameBytes) {
  steps_ = 2;
  ExpectDone({TILEGRAD_PROGRAM, "dataset", "--source", "procedural", "--limit", "12", "--size",
              "32", "--threads", "1", "--out", (folder_ / "made").string()});
  for (const TinyKind& kind : kKinds) {
    const std::string name = kind.name;
    if (name == kGan.name || name == "critic") continue;
    SCOPED_TRACE(kind.name);
    Use(kind);
    if (data_ == "data") data_ = "made";
    ASSERT_NO_FATAL_FAILURE(TrainOn(1, 1, kind.name));
    const Path run = folder_ / kind.name;
    const Words words = {TILEGRAD_PROGRAM,    "eval", "--run",  run.string(),
                         "--views-per-model", "2",    "--data", (folder_ / data_).string(),
                         "--threads",         "1"};
    ExpectDone(words);
    const auto table = ReadText(run / "eval.md"), figures = ReadText(run / "eval.json");
    for (const int ranks : {2, 3}) {
      for (const char* file : {"eval.md", "eval.json"}) std::filesystem::remove(run / file);
      ExpectDone(OnRanks(ranks, words));
      EXPECT_EQ(ReadText(run / "eval.md").value(), table.value());
      EXPECT_EQ(ReadText(run / "eval.json").value(), figures.value());
    }
  }
}

TEST_F(Ranks, OtherCommandsAreRefused) {
  const Ended ended = Do(OnRanks(2, {TILEGRAD_PROGRAM, "configs"}));
  EXPECT_EQ(ended.code, 2);
  ExpectIn(ended.output, "start this command without mpirun");
}

TEST_F(Ranks, WithoutThePluginSayHowToGetIt) {
  const Path program = folder_ / "bin" / "tilegrad";
  std::filesystem::create_directories(program.parent_path());
  std::filesystem::copy_file(TILEGRAD_PROGRAM, program);
  Words words = TrainWords("run", 1);
  words[0] = program.string();
  words.insert(words.begin(), {"/usr/bin/env", "OMPI_COMM_WORLD_SIZE=2"});
  ExpectRefused(words, 3, "built without MPI: install libopenmpi-dev");
}

}  // namespace tilegrad::train::mpirun_test
