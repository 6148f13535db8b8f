// SPDX-License-Identifier: Apache-2.0
// A training run from start, or from where it stopped, to its end.
//
//   <run>/config.toml    the complete configuration
//   <run>/run.json       dataset, machine, versions
//   <run>/training_models.txt
//   <run>/metrics.jsonl, tensorboard/, samples/, checkpoints/
#pragma once

#include <string>

#include "base/parallel.h"
#include "base/progress.h"
#include "train/config.h"

namespace tilegrad::train {

enum class ExistingRun {
  kRefuse,    // an error that says what the choices are
  kContinue,  // goes on from its newest whole checkpoint; starts if there is no run yet
};

struct TrainJob {
  TrainConfig config;
  Path data;  // dataset folder
  Path run;   // run folder
  ExistingRun existing = ExistingRun::kRefuse;
  // > 0: save and stop after this long; a resumed run goes on to the same bits.
  double max_minutes = 0;
  WarningSink warn = nullptr;  // broken checkpoints that were passed over
};

struct TrainOutcome {
  std::int64_t first_step = 0, last_step = 0;  // steps done before and after
  double seconds = 0;                          // of all sessions of this run
  bool finished = false;                       // last_step is the configuration's
};

// Saves before it returns, whether it ends by itself, by time or by `stop` (then with kCancelled
// and a message how to resume). A continued run must have the same configuration
// (schedule.log_every, sample_every, checkpoint_every, keep_checkpoints and name may differ); an
// error names the first key that differs. So must the training models be the same. Another process
// that trains in the folder is an error.
Result<TrainOutcome> Train(const TrainJob& job, const Workers& workers,
                           const ProgressSink& progress, const StopFlag& stop);

}  // namespace tilegrad::train
