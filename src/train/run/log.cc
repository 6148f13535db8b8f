// SPDX-License-Identifier: Apache-2.0
#include "train/run/log.h"

#include <fmt/format.h>

#include <bit>
#include <chrono>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_text.h"

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
  return DumpJson(json) + "\n";
}

bool Parse(std::string_view line, LogEntry* entry) {
  const Json json = ParseJsonOrDiscard<Json>(line);
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

std::uint32_t MaskedCrc(std::string_view bytes) {
  const std::uint32_t crc = Crc32c(bytes);
  return (crc >> 15 | crc << 17) + 0xA282EAD8u;
}

template <class T>
void AppendLittleEndian(std::string& out, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) out += static_cast<char>(value >> (8 * i));
}

// Protocol buffers: a key is field number << 3 | wire type.
enum WireType : std::uint8_t { kVarint = 0, kFixed64 = 1, kLengthDelimited = 2, kFixed32 = 5 };

void AppendVarint(std::string& out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) out += static_cast<char>(value | 0x80);
  out += static_cast<char>(value);
}

void AppendKey(std::string& out, int field, WireType type) {
  AppendVarint(out, static_cast<std::uint64_t>(field) << 3 | type);
}

void AppendBytes(std::string& out, int field, std::string_view bytes) {
  AppendKey(out, field, kLengthDelimited);
  AppendVarint(out, bytes.size());
  out += bytes;
}

void AppendDouble(std::string& out, int field, double value) {
  AppendKey(out, field, kFixed64);
  AppendLittleEndian(out, std::bit_cast<std::uint64_t>(value));
}

std::string Record(const std::string& event) {
  std::string length, out;
  AppendLittleEndian(length, static_cast<std::uint64_t>(event.size()));
  out = length;
  AppendLittleEndian(out, MaskedCrc(length));
  out += event;
  AppendLittleEndian(out, MaskedCrc(event));
  return out;
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
    if (!Parse(std::string_view(text).substr(at, end - at), &entry))
      return DataLoss("{}: line {} is not a JSON object with a step", MetricsFile(run).string(),
                      line_number);
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

std::uint32_t Crc32c(std::string_view bytes) {
  std::uint32_t crc = ~0u;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0x82F63B78u : 0u);
  }
  return ~crc;
}

// Event: wall_time = 1, step = 2, file_version = 3, summary = 5. Summary: value = 1. Value: tag =
// 1, simple_value = 2.
std::string TensorboardVersionRecord(double wall_time) {
  std::string event;
  AppendDouble(event, 1, wall_time);
  AppendBytes(event, 3, "brain.Event:2");
  return Record(event);
}

std::string TensorboardScalarsRecord(double wall_time, std::int64_t step, const Scalars& scalars) {
  std::string summary;
  for (const auto& [tag, value] : scalars) {
    std::string entry;
    AppendBytes(entry, 1, tag);
    AppendKey(entry, 2, kFixed32);
    AppendLittleEndian(entry, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    AppendBytes(summary, 1, entry);
  }
  std::string event;
  AppendDouble(event, 1, wall_time);
  AppendKey(event, 2, kVarint);
  AppendVarint(event, static_cast<std::uint64_t>(step));
  AppendBytes(event, 5, summary);
  return Record(event);
}

std::string StepValues::ForConsole() const {
  std::string out = fmt::format("loss {:.4f}", loss);
  for (const LossTerm& term : terms) {
    if (term.weight != 0) out += fmt::format("  {} {:.3g}", term.name, term.value);
  }
  return out;
}

std::string StepValues::DescribeTerms() const {
  std::string out;
  for (const LossTerm& term : terms)
    out += fmt::format("{}{} {} x {}", out.empty() ? "" : ", ", term.name, term.value, term.weight);
  return out;
}

Scalars StepValues::ForLog() const {
  Scalars out = {{"loss", loss}};
  for (const LossTerm& term : terms) out.emplace_back(term.name, term.value);
  for (const auto& [name, value] : also) out.emplace_back(name, value);
  return out;
}

}  // namespace tilegrad::train
