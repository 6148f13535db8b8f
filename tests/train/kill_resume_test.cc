// SPDX-License-Identifier: Apache-2.0
// The real program, which renders half of its pictures itself, is killed with SIGKILL at random
// moments and resumed: the weights, moments and
// curves are those of a run that nobody disturbed, bit for bit, whatever the number of workers and
// the size of the cache of meshes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "base/rng.h"
#include "nn/nn.h"
#include "same_run.h"
#include "support/process.h"
#include "support/temp_folder.h"
#include "tiny_run.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train::kill_resume_test {

using Seconds = std::chrono::duration<double>;
using Clock = std::chrono::steady_clock;

class KillResume : public TempFolderTest {
 protected:
  KillResume() : workers_(1), context_(workers_) {
    Write("tiny.toml", kTinyConfig + "[stream]\nshare = 0.5\n");
    std::filesystem::create_directories(folder_ / "data");
    Ok(WriteNoiseDataset(folder_ / "data", Meshes::kBoxes));
  }

  // Starts `tilegrad train` with the run folder `run`; what it prints is appended to <run>.txt.
  // `prepare` is called in the new process before the program is.
  pid_t Start(
      const std::string& run, int workers, void (*prepare)() = [] {}) const {
    std::vector<std::string> words = {TILEGRAD_PROGRAM, "train",
                                      "--config",       (folder_ / "tiny.toml").string(),
                                      "--data",         (folder_ / "data").string(),
                                      "--out",          (folder_ / run).string(),
                                      "--workers",      std::to_string(workers),
                                      "--set",          "schedule.steps=" + std::to_string(steps_),
                                      "--max-minutes",  minutes_,
                                      "--resume"};
    words.insert(words.end(), settings_.begin(), settings_.end());
    return StartProcess(words, folder_ / (run + ".txt"), prepare);
  }

  void AwaitFirstStep(const std::string& run) const {
    const Path log = folder_ / run / "metrics.jsonl";
    std::error_code error;
    for (int i = 0; i < 6000; ++i) {
      const auto size = std::filesystem::file_size(log, error);
      if (!error && size > 0) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  std::string Output(const std::string& run) const {
    return ReadText(folder_ / (run + ".txt")).value();
  }

  // Runs to the end; the seconds it took.
  double Finish(const std::string& run, int workers) {
    const auto start = Clock::now();
    EXPECT_EQ(EndProcess(Start(run, workers)), 0) << Output(run);
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
      killed += EndProcess(child) == -SIGKILL;
    }
    return killed;
  }

  void ExpectSame(const std::string& a, const std::string& b) {
    ExpectSameBits(context_, folder_ / a, folder_ / b, steps_);
    ExpectSameCurves(folder_ / a, folder_ / b, steps_);
  }

  void CheckKills(int kills) {
    const double seconds = Finish("whole", 2);
    settings_.insert(settings_.end(), {"--set", "stream.cache=1K"});  // a mesh or two
    // On a machine whose load has fallen since, a run may be over before the first of them.
    std::string run = "killed";
    int killed = KillAtRandom(run, kills, seconds);
    for (double less = seconds / 2; killed == 0 && less > 0.1; less /= 2)
      killed = KillAtRandom(run += "_again", kills, less);
    EXPECT_GT(killed, 0);
    EXPECT_FALSE(ListCheckpoints(folder_ / run).empty());  // some came after the first steps
    Finish(run, 1);
    ExpectSame("whole", run);
  }

  Workers workers_;
  nn::Context context_;
  int steps_ = 200;
  std::string minutes_ = "0";
  std::vector<std::string> settings_;  // of the command line
};

TEST_F(KillResume, ThreeKills) { CheckKills(3); }

TEST_F(KillResume, TwoKillsWithTheRulesOfOthers) {
  for (const std::string rule : {"softras", "n3mr"}) {
    for (const char* run : {"whole", "killed"}) std::filesystem::remove_all(folder_ / run);
    settings_ = {"--set", "render.rule=" + rule};
    CheckKills(2);
  }
}

TEST_F(KillResume, TwoKillsWithPortionsSideBySide) {
  settings_ = {"--set", "schedule.portions=4"};
  CheckKills(2);
}

TEST_F(KillResume, TwoKillsWithTexturesAndLight) {
  Write("tiny.toml", kTinyTextured);
  CheckKills(2);
}

TEST_F(KillResume, TwoKillsWithACritic) {
  Write("tiny.toml", kTinyTextured);
  for (const std::string& setting : kTinyCritic)
    settings_.insert(settings_.end(), {"--set", setting});
  CheckKills(2);
}

TEST_F(KillResume, LongTenKills) {
  steps_ = 1000;
  CheckKills(10);
}

TEST_F(KillResume, TerminationSavesAndSaysHowToGoOn) {
  steps_ = 100000;
  for (const auto& [run, signal] : {std::pair("terminated", SIGTERM), {"hung_up", SIGHUP}}) {
    const pid_t child = Start(run, 1);
    AwaitFirstStep(run);
    ::kill(child, signal);
    ASSERT_EQ(EndProcess(child), 128 + signal) << Output(run);
    ExpectIn(Output(run), "--resume");
    const auto found = Ok(LoadNewestCheckpoint(context_, folder_ / run));
    const auto curve = Ok(ReadLog(folder_ / run));
    ASSERT_FALSE(curve->empty());
    EXPECT_EQ(found->checkpoint.info.step, curve->back().step);  // nothing that was done is lost
  }
}

// As nohup and a shell's background do.
TEST_F(KillResume, SignalsThatWereIgnoredStayIgnored) {
  steps_ = 100000;
  minutes_ = "0.03";
  const pid_t child = Start("run", 1, [] {
    std::signal(SIGINT, SIG_IGN);
    std::signal(SIGHUP, SIG_IGN);
  });
  AwaitFirstStep("run");
  ::kill(child, SIGINT);
  ::kill(child, SIGHUP);
  EXPECT_EQ(EndProcess(child), 0) << Output("run");
}

// The progress line, after two seconds, is the first that is written there.
TEST_F(KillResume, APipeThatNobodyReadsIsNoReasonToEnd) {
  steps_ = 100000;
  minutes_ = "0.05";
  const pid_t child = Start("run", 1, [] {
    int ends[2] = {-1, -1};
    if (::pipe(ends) != 0 || ::dup2(ends[1], 2) < 0 || ::close(ends[0]) != 0) ::_exit(126);
  });
  EXPECT_EQ(EndProcess(child), 0) << Output("run");
}

}  // namespace tilegrad::train::kill_resume_test
