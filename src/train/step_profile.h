// SPDX-License-Identifier: Apache-2.0
// How a training step would scale: steps recorded on one thread (base/loop_trace.h), scheduled on
// many workers (base/loop_schedule.h), and measured on the available cores.
#pragma once

#include <vector>

#include "base/loop_schedule.h"
#include "base/progress.h"
#include "train/trainer.h"

namespace tilegrad::train {

struct ProfileRequest {
  int steps = 12;                 // to measure, >= 1, after three warm-up steps
  std::vector<int> workers = {};  // to predict, each >= 2
  // Memory bandwidth of the predicted machine, all workers together. 0: each worker gets what one
  // of this machine gets when all are busy.
  double bytes_per_second = 0;
  double start_seconds = 0;  // of LoopMachine; 0: as measured here
};

struct StepProfile {
  double one = 0;  // measured processor time of a step on one worker, seconds
  int cores = 1;   // that this process may use
  double all = 0;  // on that many workers, measured
  LoopCosts costs;
  std::vector<LoopForecast> forecasts;  // for each of ProfileRequest::workers
};

// Alternates between numbers of workers and takes the fastest step of each, so that time lost to
// other programs does not count. kCancelled when `stop` is set.
Result<StepProfile> ProfileSteps(const TrainJob& job, const ProfileRequest& request,
                                 const Watch& watch);

}  // namespace tilegrad::train
