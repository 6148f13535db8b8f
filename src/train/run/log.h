// SPDX-License-Identifier: Apache-2.0
// The curves of a run: <run>/metrics.jsonl, one JSON object a line with "step" first, and the same
// as TensorBoard events.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

using Scalars = std::vector<std::pair<std::string, double>>;  // tag, value

struct LogEntry {
  std::int64_t step = 0;  // steps done
  Scalars values;         // in the order they are written
};

// Every line that is whole; a last line that a crash cut is left out. An error names file and line
// of any other broken line.
Result<std::vector<LogEntry>> ReadLog(const Path& run);

class RunLog {
 public:
  // Keeps what was logged up to `step` and forgets what came after (a resumed run logs it again),
  // in both files.
  static Result<RunLog> Open(const Path& run, std::int64_t step);
  Status Append(const LogEntry& entry);

 private:
  explicit RunLog(const Path& run) : run_(run) {}
  Path run_;
};

// TensorBoard event files: TFRecord framing around protocol-buffer events that hold scalars. The
// few fields needed are encoded by hand; TensorFlow's crc32c masking as in
// tensorflow/core/lib/io/record_writer.

// The bytes of one record; a file is a version record followed by any number of scalar records.
std::string TensorboardVersionRecord(double wall_time);
std::string TensorboardScalarsRecord(double wall_time, std::int64_t step, const Scalars& scalars);

// Castagnoli's CRC.
std::uint32_t Crc32c(std::string_view bytes);

}  // namespace tilegrad::train
