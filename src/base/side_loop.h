// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "base/parallel.h"

namespace tilegrad {

// A loop that runs beside other loops: its caller starts it and continues with its own work, while
// some of the workers prefer its tasks over those of other loops. This keeps workers busy where the
// caller's loops have few tasks or where there is no loop: a training step prepares the pictures of
// the next. Begin and Finish are called from one thread.
class SideLoop {
 public:
  using Task = std::function<void(std::size_t index, std::size_t lane)>;

  explicit SideLoop(const Workers& workers);  // which must outlive it
  ~SideLoop();                                // waits for running tasks; drops the others
  SideLoop(const SideLoop&) = delete;
  SideLoop& operator=(const SideLoop&) = delete;

  // The number of lanes: no two tasks with the same lane overlap, so the lane selects scratch
  // memory. The first lanes are the workers', so their other loops may use the same memory.
  static std::size_t LanesOf(const Workers& workers);

  // Calls task(index, lane) once for each index in [0, n), lane in [0, LanesOf(workers)), until
  // Finish returns; a single worker calls none before Finish. The previous loop must be finished.
  // Which lane takes which index is not determined: results must depend on the index only.
  void Begin(std::size_t n, Task task, LoopSite site = LoopSite::Here());
  // All workers take waiting tasks; returns when all are done, or rethrows what a task has thrown.
  // Does nothing if there is no loop.
  void Finish();

 private:
  struct State;
  struct Helpers;
  std::shared_ptr<State> state_;  // helpers that arrive late find no tasks in it
  std::unique_ptr<Helpers> helpers_;
};

}  // namespace tilegrad
