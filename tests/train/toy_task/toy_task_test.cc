// SPDX-License-Identifier: Apache-2.0
// A task from outside of src/ goes the whole way through the public seam: it is configured,
// trains, predicts, is evaluated and reported.
#include "toy_task.h"

#include <gtest/gtest.h>

#include "support/temp_folder.h"
#include "train/predictor.h"
#include "train/report/report.h"
#include "train/tasks/registry.h"
#include "train/trainer.h"

namespace tilegrad::train::toy_task_test {

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

  Workers workers_{2};
  nn::Context context_;
};

TEST_F(ToyTaskTest, IsConfiguredByItsOwnKeys) {
  const auto config = Ok(ParseConfig(kConfig, "toy.toml"));
  ExpectIn(WriteConfig(*config), "[box]\nbatch = 8");
  ExpectMessage(ParseConfig("[task]\nkind = \"box\"\n[network]\nchannels = 4\n", "c.toml").status(),
                "c.toml", "network.channels");
  ExpectMessage(ParseConfig("[box]\nbatch = 4\n", "c.toml").status(), "box.batch",
                "schedule.batch");
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
           "untrained box", "its size as a colour", "kind = &#39;box&#39;");
}

}  // namespace tilegrad::train::toy_task_test
