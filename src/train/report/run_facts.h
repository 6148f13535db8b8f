// SPDX-License-Identifier: Apache-2.0
// What a run's folder says about it.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "train/config.h"
#include "train/run/header.h"
#include "train/run/log.h"

namespace tilegrad::train {

struct RunFacts {
  Path folder;
  RunHeader header;
  TrainConfig config;
  std::string config_text;  // config.toml as it is
  std::vector<LogEntry> log;
};

// run.json, config.toml, metrics.jsonl; errors name the file and the key or line.
Result<RunFacts> ReadRun(const Path& run);

// At most `count` entries: means over equal stretches, at the step of each stretch's last entry.
std::vector<LogEntry> Thin(const std::vector<LogEntry>& log, std::size_t count);

}  // namespace tilegrad::train
