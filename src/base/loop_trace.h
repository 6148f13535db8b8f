// SPDX-License-Identifier: Apache-2.0
// Records parallel loops on one thread: the time of each task, and of the code between loops. From
// it base/loop_schedule.h predicts the time on many workers.
#pragma once

#include <cstddef>
#include <vector>

#include "base/clocks.h"
#include "base/function_ref.h"
#include "base/parallel.h"

namespace tilegrad {

struct LoopRecord;

// What one thread executes in sequence: stretches of code without loops, and loops between them.
struct Strand {
  // Seconds. stretches[i] precedes loops[i]; one more stretch than loops.
  std::vector<double> stretches;
  std::vector<LoopRecord> loops;
};

struct LoopRecord {
  LoopSite site{};
  double bytes = 0;  // its memory traffic, as far as declared (Workers::NoteTraffic)
  std::vector<Strand> tasks;
  // > 0: a SideLoop, with this many workers taking part until the strand that began it ends.
  std::size_t helpers = 0;
  // Its tasks are those of a WorkerGroups: each runs its own loops on a group of the workers.
  bool grouped = false;
};

// Seconds of all stretches, those of tasks included.
double WorkOf(const Strand& strand);
double WorkOf(const LoopRecord& loop);

// Records the loops of the Workers made with it. Single-threaded; measures CPU time of the thread,
// so other programs do not count. Reads the clock once per loop and task, and subtracts that cost.
class LoopTrace {
 public:
  LoopTrace();
  // Discards earlier records and starts the clock.
  void Begin();
  // What ran since Begin. Not after a task has thrown.
  Strand End() const;
  // What a reading of the clock costs, as measured by the constructor.
  double reading_seconds() const { return reading_seconds_; }

 private:
  friend class Workers;
  friend class SideLoop;
  friend class WorkerGroups;
  struct Begun {
    std::size_t tasks;
    LoopSite site;
    double bytes = 0;
    std::size_t helpers = 0;
    bool grouped = false;
  };
  struct Event {  // a loop begins, or a task of the innermost open loop ends
    bool begins;
    double at = ThreadSeconds();
  };
  class Reader;
  void Run(std::size_t n, FunctionRef<void(std::size_t, std::size_t)> task, LoopSite site,
           std::size_t helpers = 0);
  void RunTasks(const Begun& loop, FunctionRef<void(std::size_t, std::size_t)> task);
  void NoteTraffic(double bytes) { traffic_ = bytes; }

  std::vector<Event> events_;
  std::vector<Begun> loops_;  // those that begin, in order
  double begin_ = 0, traffic_ = 0, reading_seconds_ = 0;
};

}  // namespace tilegrad
