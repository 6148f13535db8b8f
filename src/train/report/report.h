// SPDX-License-Identifier: Apache-2.0
// One page about a run that needs nothing but itself: what was trained, how good it is, curves,
// pictures, meshes to turn, configuration, credits. It loads nothing from anywhere.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"

namespace tilegrad::train {

struct ReportJob {
  Path run;        // with at least one whole checkpoint
  Path data;       // dataset folder
  Path out;        // the page
  int models = 8;  // held-out models to show, >= 0
  // The models that it shows in one PNG, where the task has one; empty: not written.
  Path sheet = {};
};

struct ReportSummary {
  std::size_t bytes = 0;              // of the page
  int models = 0;                     // that it shows
  bool evaluated = false;             // the run has an eval.json
  std::string sheet_columns;          // of ReportJob::sheet, if it was written
  std::vector<std::string> warnings;  // newer checkpoints that could not be read
};

// Page and sheet appear whole or not at all, the page first. The same run and dataset give the
// same bytes. Errors name the file of the run or dataset that is missing or broken.
Result<ReportSummary> WriteReport(const ReportJob& job, const Workers& workers,
                                  const ProgressSink& progress, const StopFlag& stop);

}  // namespace tilegrad::train
