// SPDX-License-Identifier: Apache-2.0
// Runs of tiny_run.h's configurations in the test's folder: trained, evaluated and reported.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "support/temp_folder.h"
#include "train/predictor.h"
#include "train/report/report.h"
#include "train/tiny_run.h"
#include "train/trainer.h"

namespace tilegrad::train {

struct TinyRun {
  std::string run = "run";  // folder
  std::string config = "";  // text
  std::vector<std::string> settings = {};
  std::string data = "data";  // folder
  int workers = 2;
  std::size_t stop_at = std::numeric_limits<std::size_t>::max();  // steps
  PictureSink drawn = nullptr;
};

class TinyRunTest : public TempFolderTest {
 protected:
  // Starts the run or continues it.
  Result<RunOutcome> Train(const TinyRun& tiny) const {
    TrainJob job;
    TILEGRAD_ASSIGN(job.config, ParseConfig(tiny.config, "tiny"));
    TILEGRAD_TRY(ApplyOverrides(tiny.settings, &job.config));
    job.data = folder_ / tiny.data;
    job.run = folder_ / tiny.run;
    job.existing = ExistingRun::kContinue;
    job.drawn = tiny.drawn;
    StopFlag stop = false;
    const auto stop_at = [&](const Progress& progress) {
      if (progress.stage == "training" && progress.done >= tiny.stop_at) stop = true;
    };
    return train::Train(job, Workers(tiny.workers), {stop_at, &stop});
  }
  Result<Evaluation> Evaluate(const std::string& run, const std::string& data,
                              int views_per_model = 24, Split split = Split::kTest) const {
    TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(folder_ / run, workers_));
    const TaskEvaluation job{.run = folder_ / run,
                             .data = folder_ / data,
                             .predictor = predictor,
                             .split = split,
                             .views_per_model = views_per_model};
    return predictor.task().Evaluate(job, workers_, {});
  }
  // The text of its report.
  std::string Page(const std::string& run, const std::string& data, int models) const {
    const ReportJob job{folder_ / run, folder_ / data, folder_ / "page.html", models};
    Ok(WriteReport(job, workers_, {}).status());
    return ReadText(job.out).value();
  }

  Workers workers_{2};
};

}  // namespace tilegrad::train
