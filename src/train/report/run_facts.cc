// SPDX-License-Identifier: Apache-2.0
#include "train/report/run_facts.h"

#include <span>

namespace tilegrad::train {
namespace {

// The means of a stretch of entries that have the same values.
LogEntry MeanEntry(std::span<const LogEntry> stretch) {
  LogEntry mean = stretch.back();
  for (std::size_t v = 0; v < mean.values.size(); ++v) {
    double sum = 0;
    int count = 0;
    for (const LogEntry& entry : stretch) {
      if (v >= entry.values.size() || entry.values[v].first != mean.values[v].first) continue;
      sum += entry.values[v].second;
      ++count;
    }
    mean.values[v].second = sum / count;
  }
  return mean;
}

}  // namespace

Result<RunFacts> ReadRun(const Path& run) {
  RunFacts facts;
  facts.folder = run;
  TILEGRAD_ASSIGN(facts.header, ReadHeader(run));
  const Path config = run / "config.toml";
  TILEGRAD_ASSIGN(facts.config_text, ReadText(config));
  TILEGRAD_ASSIGN(facts.config, ParseConfig(facts.config_text, config.string()));
  TILEGRAD_ASSIGN(facts.log, ReadLog(run));
  return facts;
}

std::vector<LogEntry> Thin(const std::vector<LogEntry>& log, std::size_t count) {
  if (log.size() <= count) return log;
  std::vector<LogEntry> out;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t begin = i * log.size() / count, end = (i + 1) * log.size() / count;
    out.push_back(MeanEntry(std::span(log).subspan(begin, end - begin)));
  }
  return out;
}

}  // namespace tilegrad::train
