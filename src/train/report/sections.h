// SPDX-License-Identifier: Apache-2.0
// The parts of the page as HTML; all text from files is escaped.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "train/config.h"
#include "train/run/log.h"
#include "train/run/run_files.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// The contents of a run's folder.
struct RunFacts {
  Path folder;
  RunHeader header;
  TrainConfig config;
  std::string config_text;  // config.toml verbatim
  std::vector<LogEntry> log;
};

// The contents of a report, gathered from the run and its task.
struct ReportFacts {
  RunFacts run;
  std::string data;       // the dataset's folder, as given
  std::string predictor;  // Predictor::description
  std::int64_t step = 0;  // of the checkpoint shown
  std::optional<Evaluation> evaluation;
  Showcase showcase;
};

std::string SummaryHtml(const ReportFacts& facts);  // what was trained on what, and how good it is
std::string ComparisonHtml(const ReportFacts& facts);      // the mean of each method as bars
Result<std::string> ModelsHtml(const ReportFacts& facts);  // a row of pictures a model
std::string ScoresHtml(const ReportFacts& facts);    // the table, or a note that there is none yet
std::string CommandsHtml(const ReportFacts& facts);  // the commands that reproduce it
std::string MachineHtml(const ReportFacts& facts);
std::string CreditsHtml(const ReportFacts& facts);

}  // namespace tilegrad::train
