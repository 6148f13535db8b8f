// SPDX-License-Identifier: Apache-2.0
// A task from outside of src/ goes the whole way through the public seam: it is configured,
// trains, is killed and continues to the same bits, predicts, is evaluated and reported.
#include "toy_task.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "nn/nn.h"
#include "support/temp_folder.h"
#include "train/predictor.h"
#include "train/report/report.h"
#include "train/run/log.h"
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

const ProgressSink kSilent = [](const Progress&) {};

Result<RunOutcome> TrainToy(const Path& run, int workers, const ProgressSink& progress = kSilent) {
  const StopFlag stop = false;
  TrainJob job;
  TILEGRAD_ASSIGN(job.config, ParseConfig(kConfig, "toy.toml"));
  job.run = run;
  job.existing = ExistingRun::kContinue;
  return Train(job, Workers(workers), progress, stop);
}

class ToyTaskTest : public TempFolderTest {
 protected:
  ToyTaskTest() : context_(workers_) { RegisterTask("box", &MakeToyTask); }

  // The state at the end of a run.
  std::vector<nn::NamedTensor> Final(const std::string& run) {
    auto found = LoadNewestCheckpoint(context_, folder_ / run);
    EXPECT_TRUE(found.ok()) << found.status().message();
    if (!found.ok()) return {};
    EXPECT_EQ(found->checkpoint.info.step, 400);
    return std::move(found->checkpoint.tensors);
  }
  // This program again, in a process of its own, as the child below.
  pid_t StartChild(const std::string& run) const {
    const pid_t child = ::fork();
    if (child != 0) return child;
    ::setenv(kFolder, (folder_ / run).c_str(), 1);
    ::execl("/proc/self/exe", "toy", "--gtest_filter=ToyTaskTest.DISABLED_Child",
            "--gtest_also_run_disabled_tests", nullptr);
    ::_exit(127);
  }
  std::size_t Logged(const std::string& run) const {
    const auto log = ReadLog(folder_ / run);
    return log.ok() ? log->size() : 0;
  }

  Workers workers_{2};
  nn::Context context_;
  StopFlag stop_ = false;
};

// A run that takes long enough to be killed in it.
TEST_F(ToyTaskTest, DISABLED_Child) {
  const char* folder = std::getenv(kFolder);
  ASSERT_NE(folder, nullptr);
  const auto wait = [](const Progress&) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  };
  EXPECT_TRUE(TrainToy(folder, 1, wait).ok());
}

TEST_F(ToyTaskTest, IsConfiguredByItsOwnKeys) {
  const auto config = ParseConfig(kConfig, "toy.toml");
  ASSERT_TRUE(config.ok()) << config.status().message();
  EXPECT_NE(WriteConfig(*config).find("[box]\nbatch = 8"), std::string::npos);
  ExpectMessage(ParseConfig("[task]\nkind = \"box\"\n[network]\nchannels = 4\n", "c.toml").status(),
                "c.toml", "network.channels");
  ExpectMessage(ParseConfig("[box]\nbatch = 4\n", "c.toml").status(), "box.batch",
                "schedule.batch");
}

TEST_F(ToyTaskTest, KilledAndContinuedEndsInTheSameBits) {
  const auto whole = TrainToy(folder_ / "whole", 2);
  ASSERT_TRUE(whole.ok()) << whole.status().message();
  for (int kill = 1; kill <= 2; ++kill) {
    const pid_t child = StartChild("killed");
    for (int i = 0; i < 3000 && Logged("killed") < 60u * static_cast<unsigned>(kill); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    ::kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status));
  }
  const auto continued = TrainToy(folder_ / "killed", 1);
  ASSERT_TRUE(continued.ok()) << continued.status().message();
  EXPECT_GE(continued->first_step, 60);
  EXPECT_TRUE(continued->finished);
  const auto left = Final("whole"), right = Final("killed");
  ASSERT_EQ(left.size(), right.size());
  ASSERT_EQ(left.size(), 8u);  // weight, bias; m, v and steps of each
  for (std::size_t i = 0; i < left.size(); ++i) {
    EXPECT_EQ(left[i].name, right[i].name);
    ASSERT_EQ(left[i].value.bytes(), right[i].value.bytes());
    EXPECT_EQ(std::memcmp(left[i].value.raw(), right[i].value.raw(), left[i].value.bytes()), 0)
        << left[i].name;
  }
  const auto a = ReadLog(folder_ / "whole"), b = ReadLog(folder_ / "killed");
  ASSERT_TRUE(a.ok() && b.ok());
  ASSERT_EQ(a->size(), 400u);
  ASSERT_EQ(b->size(), 400u);
  for (std::size_t i = 0; i < a->size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(a->at(i).values[k], b->at(i).values[k]);
  }
}

TEST_F(ToyTaskTest, LearnsPredictsIsEvaluatedAndReported) {
  const Path run = folder_ / "run";
  const auto trained = TrainToy(run, 2);
  ASSERT_TRUE(trained.ok()) << trained.status().message();
  const auto log = ReadLog(run);
  ASSERT_TRUE(log.ok());
  EXPECT_EQ(log->back().values[1].first, "size");
  EXPECT_LT(log->back().values[1].second, 0.1 * log->front().values[1].second);
  EXPECT_TRUE(std::filesystem::exists(run / "samples" / "step_00000400.png"));

  const auto predictor = Predictor::Load(run, workers_);
  ASSERT_TRUE(predictor.ok()) << predictor.status().message();
  EXPECT_EQ(predictor->description(), "toy network, 12 parameters, step 400");
  const auto evaluation =
      predictor->task().Evaluate({run, {}, *predictor}, workers_, kSilent, stop_);
  ASSERT_TRUE(evaluation.ok()) << evaluation.status().message();
  EXPECT_GT(evaluation->rows[1].mean.iou, 0.8);
  EXPECT_GT(evaluation->rows[1].mean.iou, evaluation->rows[0].mean.iou);
  ASSERT_TRUE(WriteEvaluation(run, *evaluation).ok());

  const ReportJob job{run, {}, folder_ / "page.html", 3};
  const auto report = WriteReport(job, workers_, kSilent, stop_);
  ASSERT_TRUE(report.ok()) << report.status().message();
  EXPECT_EQ(report->models, 3);
  const std::string page = ReadText(job.out).value();
  for (const char* part :
       {"to tell the size of a box by its colour", "Squared error of sizes", "above every baseline",
        "untrained box", "its size as a colour", "kind = &#39;box&#39;"}) {
    EXPECT_NE(page.find(part), std::string::npos) << part;
  }
}

}  // namespace tilegrad::train::toy_task_test
