// SPDX-License-Identifier: Apache-2.0
// Loops on workers whose tasks may fail.
#pragma once

#include "base/parallel.h"
#include "base/progress.h"

namespace tilegrad {

using FallibleTask = FunctionRef<Status(std::size_t index, std::size_t worker)>;

// Workers::For; runs every task, also after an error. Returns the error of the lowest index.
Status TryAll(const Workers& workers, std::size_t n, FallibleTask task,
              LoopSite site = LoopSite::Here());

struct WatchedStage {
  const char* name;  // "rendering", ...
  const Watch& watch;
};

// The same for long work: reports after each task how many are done. Starts no more tasks once it
// should stop, and returns kCancelled, "stopped while <name>".
Status TryAll(const Workers& workers, std::size_t n, const WatchedStage& stage, FallibleTask task,
              LoopSite site = LoopSite::Here());

}  // namespace tilegrad
