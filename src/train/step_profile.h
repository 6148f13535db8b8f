// SPDX-License-Identifier: Apache-2.0
// How a training step would scale: steps recorded on one thread (base/loop_trace.h), scheduled on
// many workers (base/loop_schedule.h), and measured with the cores that are there.
#pragma once

#include <vector>

#include "base/loop_schedule.h"
#include "base/progress.h"
#include "train/trainer.h"

namespace tilegrad::train {

struct ProfileRequest {
  int steps = 12;                 // to measure, >= 1; three more come before
  std::vector<int> workers = {};  // to predict, each >= 2
  // Of the machine that is asked about, all of its workers together. 0: each has what one of this
  // machine has when all are busy.
  double bytes_per_second = 0;
  double start_seconds = 0;  // of LoopMachine; 0: as measured here
};

struct StepProfile {
  double one = 0;  // seconds of a step on one worker, measured, of its processor time
  int cores = 1;   // that this process may use
  double all = 0;  // on that many workers, measured
  LoopCosts costs;
  std::vector<LoopForecast> forecasts;  // for each of ProfileRequest::workers
};

// Steps with different numbers of workers take turns, and of each the fastest counts: what other
// programs take away is not the step's. kCancelled when `stop` is set.
Result<StepProfile> ProfileSteps(const TrainJob& job, const ProfileRequest& request,
                                 const ProgressSink& progress, const StopFlag& stop);

}  // namespace tilegrad::train
