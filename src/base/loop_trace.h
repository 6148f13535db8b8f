// SPDX-License-Identifier: Apache-2.0
// What parallel loops do, recorded on one thread: how long each of their tasks takes, and what
// stands between them. base/loop_schedule.h predicts from it what many workers would take.
#pragma once

#include <cstddef>
#include <vector>

#include "base/clocks.h"
#include "base/function_ref.h"
#include "base/parallel.h"

namespace tilegrad {

struct LoopRecord;

// What one thread does in turn: stretches without loops, and loops between them.
struct Strand {
  // stretches[i] comes before loops[i]; one more stretch than loops. Seconds.
  std::vector<double> stretches;
  std::vector<LoopRecord> loops;
};

struct LoopRecord {
  LoopSite site{};
  double bytes = 0;  // that it moves in memory, as far as it says (Workers::NoteTraffic)
  std::vector<Strand> tasks;
  // > 0: a SideLoop, which so many workers take part in until the strand that began it has ended.
  std::size_t helpers = 0;
};

// Seconds of all stretches.
double WorkOf(const Strand& strand);
double WorkOf(const LoopRecord& loop);

// Records the loops of the Workers that are made with it. Of one thread, whose processor time it
// reads: what other programs take away is not the loops'. A reading for each loop and task is all
// that recording adds.
class LoopTrace {
 public:
  // Forgets what was recorded; the clock starts.
  void Begin();
  // What was done since Begin. Not after a task has thrown.
  Strand End() const;

 private:
  friend class Workers;
  friend class SideLoop;
  struct Event {            // a loop begins, or a task of the innermost open loop ends
    std::size_t tasks = 0;  // of the loop that begins
    LoopSite site{};
    double bytes = 0;
    std::size_t helpers = 0;
    double at = ThreadSeconds();
  };
  class Reader;
  void Run(std::size_t n, FunctionRef<void(std::size_t, std::size_t)> task, LoopSite site,
           std::size_t helpers = 0);
  void NoteTraffic(double bytes) { traffic_ = bytes; }

  std::vector<Event> events_;
  double begin_ = 0, traffic_ = 0;
};

}  // namespace tilegrad
