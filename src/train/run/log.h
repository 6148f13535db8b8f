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

// TensorBoard event files: TFRecord framing, with crc32c masked as in TensorFlow's record_writer,
// around protocol-buffer events whose few fields are encoded by hand.
// The bytes of one record; a file is a version record followed by any number of scalar records.
std::string TensorboardVersionRecord(double wall_time);
std::string TensorboardScalarsRecord(double wall_time, std::int64_t step, const Scalars& scalars);

// Castagnoli's CRC.
std::uint32_t Crc32c(std::string_view bytes);

// What a step says about itself. The log, TensorBoard, the console and the report show whatever
// terms there are; none of them knows one by name.

struct LossTerm {
  const char* name;        // its key in metrics.jsonl; not "step", "loss", "images_per_second",
                           // "seconds", "stream_share", "wait_share", "summed_numbers"
  double weight;           // in the loss; 0: only watched
  double value;            // before the weight
  const char* label = "";  // for people; "": the name says it
};

// Cleared and filled anew by each step: a steady state keeps the memory.
struct StepValues {
  double loss = 0;  // what the step went down on
  std::vector<LossTerm> terms;
  std::vector<std::pair<const char*, double>> also;  // for the log: learning rate, epoch, ...
  std::int64_t images = 0;                           // that the step worked on
  double stream_seconds = 0;  // of processor time, for pictures that it rendered to learn from
  double wait_seconds = 0;    // for gradients of other ranks, after its own were there
  double summed_numbers = 0;  // with other ranks, in all updates of the step

  void Clear() {  // all but the loss, which a step may leave as it was
    terms.clear();
    also.clear();
    images = 0;
    stream_seconds = wait_seconds = summed_numbers = 0;
  }
  // The loss, and its terms without their weights: "loss 2.5690  iou 0.246  color 0.111".
  std::string ForConsole() const;
  // "iou 0.5 x 1, color nan x 1".
  std::string DescribeTerms() const;
  // "loss", the terms without their weights, then `also`.
  Scalars ForLog() const;
};

}  // namespace tilegrad::train
