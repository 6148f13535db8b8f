// SPDX-License-Identifier: Apache-2.0
// Predicts how long a recorded strand of work would take on many workers, by greedy scheduling: an
// idle worker takes the next task of the oldest loop that has one; a SideLoop begun within a strand
// ends with it; each group of a WorkerGroups schedules its own loops. R. Graham, Bounds on
// multiprocessing timing anomalies, 1969: at most work / workers + the longest chain of tasks.
#pragma once

#include <string>
#include <vector>

#include "base/loop_trace.h"

namespace tilegrad {

// The machine to predict for.
struct LoopMachine {
  int workers = 1;
  // From the start of a loop until a second worker joins, and again until each doubling of their
  // number, since workers wake each other. Nested loops find others awake and start at once.
  double start_seconds = 0;
  // Memory bandwidth of all workers together, which bounds each loop from below. 0: no limit.
  double bytes_per_second = 0;
};

// One place in the program: all runs of one loop, or all stretches between two loops. Of loops
// within groups, those of the slowest group count, their work once per group.
struct HeldBack {
  std::string place;  // "nn/optim.cc:76"; of stretches "nn/optim.cc:76 .. nn/optim.cc:242"
  int times = 0;
  double work = 0;    // seconds on one worker
  double taken = 0;   // predicted seconds
  double wasted = 0;  // taken - work / workers
};

struct LoopForecast {
  double seconds = 0;
  // By wasted time, largest first; it sums to `seconds` minus all work / workers.
  std::vector<HeldBack> places;
};

LoopForecast Forecast(const Strand& strand, const LoopMachine& machine);

// The cost of loops on this machine, measured with all workers.
struct LoopCosts {
  double start_seconds = 0;     // as in LoopMachine
  double bytes_per_second = 0;  // read and written by all workers together
};
LoopCosts MeasureLoopCosts(const Workers& workers);

}  // namespace tilegrad
