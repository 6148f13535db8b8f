// SPDX-License-Identifier: Apache-2.0
// Progress and cancellation of long-running work, without the library printing or catching
// signals.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "base/error.h"

namespace tilegrad {

struct Progress {
  std::string stage;        // "rendering", "training", ...
  std::uint64_t done = 0;   // units finished
  std::uint64_t total = 0;  // units of this stage; 0 if unknown
  std::string note;         // rates and losses to show, or empty
};

// Called from one thread at a time, as often as the work likes; the receiver limits its redraws.
using ProgressSink = std::function<void(const Progress&)>;

// Receives problems that were worked around, at once, since the work may be stopped before it ends.
using WarningSink = std::function<void(const std::string&)>;

// Set from a signal handler or another thread; long work checks it between units, saves, and
// returns StatusCode::kCancelled.
using StopFlag = std::atomic<bool>;

// Both. Either may be absent.
struct Watch {
  ProgressSink progress = nullptr;
  const StopFlag* stop = nullptr;

  bool stopped() const { return stop != nullptr && *stop; }
  void Report(const Progress& now) const {
    if (progress) progress(now);
  }
  // Reports progress; returns kCancelled, "stopped while <stage>" and `left`, if the work should
  // stop.
  Status At(const Progress& now, const char* left = "") const {
    if (stopped()) return Cancelled("stopped while {}{}", now.stage, left);
    Report(now);
    return {};
  }
};

// What stopped work has left, if it writes only at its end.
inline constexpr const char* kNothingWritten = "; nothing was written";

}  // namespace tilegrad
