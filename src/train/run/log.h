// SPDX-License-Identifier: Apache-2.0
// The curves of a run: <run>/metrics.jsonl, one JSON object a line with "step" first, and the same
// as TensorBoard events.
#pragma once

#include "base/file.h"
#include "train/run/tensorboard.h"

namespace tilegrad::train {

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

}  // namespace tilegrad::train
