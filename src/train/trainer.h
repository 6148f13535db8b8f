// SPDX-License-Identifier: Apache-2.0
// Training of a task: a run (run/run.h) whose steps are the task's.
//
//   <run>/config.toml    the complete configuration
//   <run>/run.json       dataset, machine, versions
//   <run>/metrics.jsonl, tensorboard/, samples/, checkpoints/, and what the task adds
#pragma once

#include <functional>
#include <memory>

#include "base/parallel.h"
#include "train/config.h"
#include "train/ranks/process_group.h"
#include "train/run/run.h"

namespace tilegrad::train {

struct TrainJob {
  TrainConfig config;
  Path data;  // dataset folder
  Path run;   // run folder
  ExistingRun existing = ExistingRun::kRefuse;
  // Of a run that is continued: `config` may ask for another number of steps than it began with.
  // What follows a schedule over all steps then follows the new one from where the run is.
  bool extends = false;
  // > 0: save and stop after this long; a continued run ends in the same bits.
  double max_minutes = 0;
  // The ranks that train together, each with this job and a dataset of the same contents; null:
  // this process alone. Only rank 0 looks at `run`.
  ProcessGroup* group = nullptr;
  WarningSink warn = nullptr;  // broken checkpoints that were passed over, and the task's warnings
  PictureSink drawn = nullptr;
  std::function<Status()> begun = nullptr;  // once the run has its folder
};

// The steps of a training without its run: nothing is written. For measurements: what a step has
// begun for the next one is done when it returns.
class Rehearsal {
 public:
  virtual ~Rehearsal() = default;
  virtual Status Step() = 0;  // the next one
};
// Of job.config and job.data, on one process. Job and workers outlive it.
Result<std::unique_ptr<Rehearsal>> Rehearse(const TrainJob& job, const Workers& workers,
                                            const ProgressSink& progress, const StopFlag& stop);

// As ExecuteRun. With a group, every rank calls it and rank 0's result tells; after an error with
// ProcessGroup::broken() the ranks can only be aborted. Two runs have the same configuration if all
// keys but these are equal: name, schedule.log_every, sample_every, checkpoint_every,
// keep_checkpoints.
Result<RunOutcome> Train(const TrainJob& job, const Workers& workers, const ProgressSink& progress,
                         const StopFlag& stop);

}  // namespace tilegrad::train
