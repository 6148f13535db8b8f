// SPDX-License-Identifier: Apache-2.0
// The terminal side of long work: a progress line with an ETA, and Ctrl-C that asks to stop instead
// of killing.
#pragma once

#include <chrono>

#include "base/progress.h"

namespace tilegrad::cli {

// Draws "stage  12/820  1%  0:31 left  note" on stderr: rewritten in place on a terminal, a line
// every ten seconds elsewhere. Work that ends within two seconds draws nothing. Finish() (or a new
// stage, or the destructor) ends the line.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  ProgressSink Sink();  // valid while this lives
  void Finish();

 private:
  using Clock = std::chrono::steady_clock;
  void Show(const Progress& progress);
  void Draw(const Progress& progress, double seconds);

  bool terminal_;
  bool drawn_ = false;  // something of this stage is on the screen
  Progress last_;
  std::uint64_t first_done_ = 0;  // done at the start of the stage: what a resumed run did earlier
                                  // says nothing of its speed
  Clock::time_point stage_start_, last_draw_;
};

// "1:05:09", "3:07" or "0:04".
std::string FormatDuration(double seconds);

// A flag that SIGINT and SIGTERM set; installed at the first call. A second signal kills as usual.
const StopFlag& StopOnSignals();

}  // namespace tilegrad::cli
