// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "base/parallel.h"

namespace tilegrad {

// A loop that runs beside other loops: its caller begins it and continues with its own work, while
// some of the workers take its tasks before those of other loops. So no worker is idle where the
// caller's loops have few tasks, or where there is none: a training step prepares the next one's
// pictures so. One thread begins and finishes it.
class SideLoop {
 public:
  using Task = std::function<void(std::size_t index, std::size_t lane)>;

  explicit SideLoop(const Workers& workers);  // which outlive it
  ~SideLoop();  // waits for the tasks that run; the others are left out
  SideLoop(const SideLoop&) = delete;
  SideLoop& operator=(const SideLoop&) = delete;

  // The lanes of tasks: no two tasks with the same lane overlap, so it selects scratch memory. The
  // first are the workers', so that other loops of theirs may use the same memory.
  static std::size_t LanesOf(const Workers& workers);

  // Calls task(index, lane) once for each index in [0, n), lane in [0, LanesOf(workers)), until
  // Finish returns; a single worker calls none before Finish. The loop before it is finished. Which
  // lane takes which index is not determined: results must depend on the index only.
  void Begin(std::size_t n, Task task, LoopSite site = LoopSite::Here());
  // All workers take the tasks that wait; returns when all are done, or throws what one has thrown.
  // Without a loop it does nothing.
  void Finish();

 private:
  struct State;
  struct Helpers;
  std::shared_ptr<State> state_;  // helpers that come late find it without tasks
  std::unique_ptr<Helpers> helpers_;
};

}  // namespace tilegrad
