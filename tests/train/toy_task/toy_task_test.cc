// SPDX-License-Identifier: Apache-2.0
// A task from outside of src/ goes the whole way through the public seam: it is configured,
// trains, is killed and continues to the same bits, predicts, is evaluated and reported.
#include "toy_task.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

#include "support/process.h"
#include "support/temp_folder.h"
#include "train/predictor.h"
#include "train/report/report.h"
#include "train/same_run.h"
#include "train/tasks/registry.h"
#include "train/trainer.h"

namespace tilegrad::train::toy_task_test {

constexpr const char* kFolder = "TILEGRAD_TOY_FOLDER";
constexpr const char* kConfig = R"(name = "toy"
[task]
kind = "box"
[box]
batch = 8
[schedule]
steps = 400
log_every = 1
sample_every = 200
checkpoint_every = 7
)";

const Watch kSilent = {[](const Progress&) {}};

Result<RunOutcome> TrainToy(const Path& run, int workers, const Watch& watch = kSilent) {
  TrainJob job;
  TILEGRAD_ASSIGN(job.config, ParseConfig(kConfig, "toy.toml"));
  job.run = run;
  job.existing = ExistingRun::kContinue;
  return Train(job, Workers(workers), watch);
}

class ToyTaskTest : public TempFolderTest {
 protected:
  ToyTaskTest() : context_(workers_) { RegisterTask("box", &MakeToyTask); }

  // This program again, in a process of its own, as the child below.
  pid_t StartChild(const std::string& run) const {
    ::setenv(kFolder, (folder_ / run).c_str(), 1);
    return StartProcess({"/proc/self/exe", "--gtest_filter=ToyTaskTest.DISABLED_Child",
                         "--gtest_also_run_disabled_tests"},
                        folder_ / "child.txt");
  }
  std::size_t Logged(const std::string& run) const {
    const auto log = ReadLog(folder_ / run);
    return log.ok() ? log->size() : 0;
  }

  Workers workers_{2};
  nn::Context context_;
};

// A run that takes long enough to be killed in it.
TEST_F(ToyTaskTest, DISABLED_Child) {
  const char* folder = std::getenv(kFolder);
  ASSERT_NE(folder, nullptr);
  const auto wait = [](const Progress&) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  };
  EXPECT_TRUE(TrainToy(folder, 1, {wait}).ok());
}

TEST_F(ToyTaskTest, IsConfiguredByItsOwnKeys) {
  const auto config = Ok(ParseConfig(kConfig, "toy.toml"));
  ExpectIn(WriteConfig(*config), "[box]\nbatch = 8");
  ExpectMessage(ParseConfig("[task]\nkind = \"box\"\n[network]\nchannels = 4\n", "c.toml").status(),
                "c.toml", "network.channels");
  ExpectMessage(ParseConfig("[box]\nbatch = 4\n", "c.toml").status(), "box.batch",
                "schedule.batch");
}

TEST_F(ToyTaskTest, KilledAndContinuedEndsInTheSameBits) {
  const auto whole = Ok(TrainToy(folder_ / "whole", 2));
  for (int kill = 1; kill <= 2; ++kill) {
    const pid_t child = StartChild("killed");
    for (int i = 0; i < 3000 && Logged("killed") < 60u * static_cast<unsigned>(kill); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    ::kill(child, SIGKILL);
    ASSERT_EQ(EndProcess(child), -SIGKILL);
  }
  const auto continued = Ok(TrainToy(folder_ / "killed", 1));
  EXPECT_GE(continued->first_step, 60);
  EXPECT_TRUE(continued->finished);
  EXPECT_EQ(FinalTensors(context_, folder_ / "whole", 400).size(),
            8u);  // weight, bias; m, v and steps of each
  ExpectSameBits(context_, folder_ / "whole", folder_ / "killed", 400);
  ExpectSameCurves(folder_ / "whole", folder_ / "killed", 400);
}

TEST_F(ToyTaskTest, LearnsPredictsIsEvaluatedAndReported) {
  const Path run = folder_ / "run";
  const auto trained = Ok(TrainToy(run, 2));
  const auto log = Ok(ReadLog(run));
  EXPECT_EQ(log->back().values[1].first, "size");
  EXPECT_LT(log->back().values[1].second, 0.1 * log->front().values[1].second);
  EXPECT_TRUE(std::filesystem::exists(run / "samples" / "step_00000400.png"));

  const auto predictor = Ok(Predictor::Load(run, workers_));
  EXPECT_EQ(predictor->description(), "toy network, 12 parameters, step 400");
  const auto evaluation = Ok(predictor->task().Evaluate({run, {}, *predictor}, workers_, kSilent));
  EXPECT_GT(evaluation->rows[1].mean.iou, 0.8);
  EXPECT_GT(evaluation->rows[1].mean.iou, evaluation->rows[0].mean.iou);
  ASSERT_TRUE(WriteEvaluation(run, *evaluation).ok());

  const ReportJob job{run, {}, folder_ / "page.html", 3};
  const auto report = Ok(WriteReport(job, workers_, kSilent));
  EXPECT_EQ(report->models, 3);
  const std::string page = ReadText(job.out).value();
  ExpectIn(page, "to tell the size of a box by its colour", "Squared error of sizes",
           "above every baseline", "untrained box", "its size as a colour", "kind = &#39;box&#39;");
}

}  // namespace tilegrad::train::toy_task_test
