// SPDX-License-Identifier: Apache-2.0
#include "train/run/log.h"

#include <chrono>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;

Path MetricsFile(const Path& run) { return run / "metrics.jsonl"; }
// TensorBoard wants "tfevents" in the name; a fixed one lets a resumed run replace it.
Path EventsFile(const Path& run) {
  return run / "tensorboard" / "events.out.tfevents.0000000000.tilegrad";
}

double WallTime() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::string ToLine(const LogEntry& entry) {
  Json json = {{"step", entry.step}};
  for (const auto& [tag, value] : entry.values) json[tag] = value;
  return json.dump() + "\n";
}

bool Parse(std::string_view line, LogEntry* entry) {
  const Json json = Json::parse(line, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("step") || !json["step"].is_number_unsigned() ||
      json["step"].get<std::uint64_t>() > INT64_MAX) {
    return false;
  }
  entry->step = json["step"].get<std::int64_t>();
  entry->values.clear();
  for (const auto& [key, value] : json.items()) {
    if (key != "step" && value.is_number()) entry->values.emplace_back(key, value.get<double>());
  }
  return true;
}

}  // namespace

Result<std::vector<LogEntry>> ReadLog(const Path& run) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(MetricsFile(run)));
  std::vector<LogEntry> entries;
  std::size_t line_number = 0;
  for (std::size_t at = 0; at < text.size();) {
    ++line_number;
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) break;  // cut by a crash
    LogEntry entry;
    if (!Parse(std::string_view(text).substr(at, end - at), &entry)) {
      return DataLoss("{}: line {} is not a JSON object with a step", MetricsFile(run).string(),
                      line_number);
    }
    entries.push_back(std::move(entry));
    at = end + 1;
  }
  return entries;
}

Result<RunLog> RunLog::Open(const Path& run, std::int64_t step) {
  std::string lines, events = TensorboardVersionRecord(WallTime());
  auto entries = ReadLog(run);
  if (!entries.ok() && entries.status().code() != StatusCode::kNotFound) return entries.status();
  if (entries.ok()) {
    for (const LogEntry& entry : *entries) {
      if (entry.step > step) continue;
      lines += ToLine(entry);
      events += TensorboardScalarsRecord(WallTime(), entry.step, entry.values);
    }
  }
  TILEGRAD_TRY(WriteTextAtomic(MetricsFile(run), lines));
  TILEGRAD_TRY(WriteTextAtomic(EventsFile(run), events));
  return RunLog(run);
}

Status RunLog::Append(const LogEntry& entry) {
  TILEGRAD_TRY(AppendText(MetricsFile(run_), ToLine(entry), /*durable=*/false));
  return AppendText(EventsFile(run_),
                    TensorboardScalarsRecord(WallTime(), entry.step, entry.values),
                    /*durable=*/false);
}

}  // namespace tilegrad::train
