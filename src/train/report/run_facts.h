// SPDX-License-Identifier: Apache-2.0
// What a run's folder says about it.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"
#include "train/config.h"
#include "train/eval/evaluate.h"
#include "train/run/log.h"

namespace tilegrad::train {

struct RunFacts {
  Path folder;
  TrainConfig config;
  std::string config_text;     // config.toml as it is
  std::string dataset;         // folder, as training was given it
  std::string dataset_source;  // DatasetInfo::source
  int training_models = 0;
  int parameters = 0;
  std::vector<std::pair<std::string, std::string>> machine;
  std::vector<LogEntry> log;
};

// run.json, config.toml, metrics.jsonl; errors name the file and the key or line.
Result<RunFacts> ReadRun(const Path& run);

// What WriteEvaluation wrote; nothing if there is no eval.json. Models that `dataset` does not have
// are left out of Evaluation::models.
Result<std::optional<Evaluation>> ReadEvaluation(const Path& run, const Dataset& dataset);

// At most `count` entries: means over equal stretches, at the step of each stretch's last entry.
std::vector<LogEntry> Thin(const std::vector<LogEntry>& log, std::size_t count);

}  // namespace tilegrad::train
