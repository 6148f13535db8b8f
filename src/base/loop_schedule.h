// SPDX-License-Identifier: Apache-2.0
// What a recorded strand of work would take on many workers, by greedy scheduling: an idle worker
// takes the next task of the oldest loop that has one; a SideLoop begun within it is over when the
// strand is. R. Graham, Bounds on multiprocessing timing
// anomalies, 1969: at most work / workers + the longest chain of tasks.
#pragma once

#include <string>
#include <vector>

#include "base/loop_trace.h"

namespace tilegrad {

// The machine that is asked about.
struct LoopMachine {
  int workers = 1;
  // From the begin of a loop until a second worker takes part, and until twice as many do each
  // time: workers wake each other. Loops within loops find others awake and start at once.
  double start_seconds = 0;
  // Of all workers together to memory: a loop takes no less than its bytes need. 0: no limit.
  double bytes_per_second = 0;
};

// One place in the program: all its loops, or all stretches between two loops.
struct HeldBack {
  std::string place;  // "nn/optim.cc:76"; of stretches "nn/optim.cc:76 .. nn/optim.cc:242"
  int times = 0;
  double work = 0;    // seconds on one worker
  double taken = 0;   // predicted seconds
  double wasted = 0;  // taken - work / workers
};

struct LoopForecast {
  double seconds = 0;
  // By wasted time, the most first; sums to `seconds` minus the share of all work.
  std::vector<HeldBack> places;
};

LoopForecast Forecast(const Strand& strand, const LoopMachine& machine);

// What loops cost on this machine, measured with all of the workers.
struct LoopCosts {
  double start_seconds = 0;     // of LoopMachine
  double bytes_per_second = 0;  // that all workers together read and write
};
LoopCosts MeasureLoopCosts(const Workers& workers);

}  // namespace tilegrad
