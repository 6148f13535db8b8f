// SPDX-License-Identifier: Apache-2.0
// Trains a task: a run (run/run.h) whose steps are the task's.
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
  // Allows `config` of a resumed run to change the number of steps. Schedules over the whole run
  // then use the new length from the present step on.
  bool extends = false;
  // > 0: save and stop after this time; a resumed run ends in the same bits.
  double max_minutes = 0;
  // The ranks that train together, each with this job and a dataset of the same contents; null:
  // this process alone. Only rank 0 uses `run`.
  ProcessGroup* group = nullptr;
  WarningSink warn = nullptr;  // skipped broken checkpoints, and the task's warnings
  PictureSink drawn = nullptr;
  std::function<Status()> begun = nullptr;  // called once the run folder exists
};

// Training steps without a run: writes nothing. For measurements: a step returns only when its
// prefetch for the next one is done.
class Rehearsal {
 public:
  virtual ~Rehearsal() = default;
  virtual Status Step() = 0;  // the next one
};
// Of job.config and job.data, on one process. Job and workers outlive it.
Result<std::unique_ptr<Rehearsal>> Rehearse(const TrainJob& job, const Workers& workers,
                                            const Watch& watch);

// As ExecuteRun. With a group, every rank calls it and rank 0's result counts; after an error with
// ProcessGroup::broken() the ranks can only be aborted. Two runs have the same configuration if all
// keys but these are equal: name, schedule.log_every, sample_every, checkpoint_every,
// keep_checkpoints.
Result<RunOutcome> Train(const TrainJob& job, const Workers& workers, const Watch& watch);

}  // namespace tilegrad::train
