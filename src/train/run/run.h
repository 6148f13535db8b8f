// SPDX-License-Identifier: Apache-2.0
// A run: a folder, and the steps taken in it. Holds whatever does not depend on what is computed:
// lock, comparison with an earlier configuration, restoring, logging, pictures, saving, stopping.
// Training (train/trainer.h) and fitting (fit/run.h) are the two kinds of work.
//
//   <run>/config.toml                    if the work writes one: what a run is continued with
//   <run>/metrics.jsonl, tensorboard/    the curves
//   <run>/checkpoints/                   see checkpoint.h
#pragma once

#include <bit>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/progress.h"
#include "nn/context.h"
#include "nn/tensor.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "train/run/checkpoint.h"
#include "train/run/config_fields.h"
#include "train/run/log.h"

namespace tilegrad::train {

// How long a run is, and what it leaves behind on the way.
struct Schedule {
  std::int64_t steps = 50000;
  std::int64_t seed = 1;        // of everything that is random
  std::int64_t portions = 1;    // of a batch, run/portion.h
  std::int64_t log_every = 20;  // steps
  std::int64_t sample_every = 1000;
  std::int64_t checkpoint_every = 500;
  std::int64_t keep_checkpoints = 3;  // the newest ones
};

// Whether a sample sheet is due after `steps` steps: every `sample_every`, at the end, and earlier
// after 10, 20, 40, ..., so that slow tasks show something soon.
inline bool SampleIsDue(const Schedule& s, std::int64_t steps) {
  if (steps <= 0) return false;
  if (steps % s.sample_every == 0 || steps == s.steps) return true;
  const bool early = steps % 10 == 0 && std::has_single_bit(static_cast<std::uint64_t>(steps / 10));
  return early && steps < s.sample_every;
}

// Its keys, in table [schedule].
inline ConfigFields FieldsOf(Schedule* s) {
  const auto reporting = Affects::kReporting;
  return {
      {"schedule.steps", &s->steps, 1, kNoLimit, "number of training steps"},
      {"schedule.seed", &s->seed, 0, kNoLimit, "seed of weights, order and views"},
      {"schedule.portions", &s->portions, 1, 1 << 20,
       "portions of a batch, each computed independently, for up to as many groups of threads or "
       "processes; a power of two"},
      {"schedule.log_every", &s->log_every, 1, kNoLimit, "steps", reporting},
      {"schedule.sample_every", &s->sample_every, 1, kNoLimit,
       "steps between samples; the first ones are at 10, 20, 40 and so on", reporting},
      {"schedule.checkpoint_every", &s->checkpoint_every, 1, kNoLimit, "steps", reporting},
      {"schedule.keep_checkpoints", &s->keep_checkpoints, 1, kNoLimit,
       "number of newest checkpoints to keep", reporting}};
}

enum class ExistingRun {
  kRefuse,    // an error that says what the choices are
  kContinue,  // continues from its newest whole checkpoint; starts if there has been none yet; an
              // error if its log says that there were some
  kReplace,   // its files go (run_files.h), others stay; starts anew
};

// Told of each picture of a run once it is written.
using PictureSink = std::function<void(const Path& file)>;

struct RunPlan {
  std::string stage;            // what the progress line calls it: "training"
  Path folder;                  // of the run
  std::string settings;         // text that every checkpoint keeps
  std::string pictures;         // how their names begin, in the folder: "samples/step_"
  std::int64_t image_size = 0;  // pixels; a run continues with the same
  double half_extent = CheckpointInfo().half_extent;
  Schedule schedule{};
  ExistingRun existing = ExistingRun::kRefuse;
  // The setting that may differ from the run's own, "schedule.steps"; empty: none.
  std::string may_differ = {};
  bool locked = false;         // the caller holds the folder's lock already
  double max_minutes = 0;      // > 0: save and stop after this long
  WarningSink warn = nullptr;  // of broken checkpoints passed over
  PictureSink drawn = nullptr;
};

// What is computed in a run.
class RunWork {
 public:
  virtual ~RunWork() = default;

  // The lines of such a text as RunPlan::settings on which the result depends. `place` is the file
  // that holds it, for errors.
  virtual Result<std::string> ResultSettings(const std::string& settings,
                                             const std::string& place) const = 0;
  // Once, after LoadState: writes the files beside the checkpoints. `first_step` steps are done.
  virtual Status Begin(std::int64_t first_step) = 0;

  // Step number `step`, from 0. An error leaves everything as it was before the step.
  virtual Status Step(std::int64_t step, StepValues* values) = 0;

  // Everything that later steps depend on, under unique names, after `steps` steps.
  virtual std::vector<nn::NamedTensor> State() = 0;
  virtual Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) = 0;

  // The steps of the whole run, as it looks now: those of its schedule, or fewer.
  virtual std::int64_t End(std::int64_t scheduled) const { return scheduled; }

  // The picture after `steps` steps (0: before the first), if any; an empty one is not written.
  virtual bool HasPicture(std::int64_t steps) const = 0;
  virtual Result<ImageU8> Picture(std::int64_t steps) = 0;
  // The mesh as it is then, for pages that show it forming; without faces: none is written.
  virtual Mesh PictureMesh() const { return {}; }
};

struct RunOutcome {
  std::int64_t first_step = 0, last_step = 0;  // steps done before and after
  double seconds = 0;                          // of all sessions of this run
  bool finished = false;                       // last_step is the end
};

// Refuses or accepts what is in the folder, before anything expensive: ExecuteRun does it again.
// The first needs no settings to compare.
Status CheckExistingRun(const Path& folder, ExistingRun existing);
Status CheckExistingRun(const RunPlan& plan, const RunWork& work);

// Saves before it returns, also when stopped by time or by `stop` (then with kCancelled). A run
// that was stopped or killed ends in the same bits when continued. Errors: another process works in
// the folder; other settings (names the first line that differs) or image size; those of `work`.
Result<RunOutcome> ExecuteRun(const RunPlan& plan, RunWork* work, nn::Context& context,
                              const Watch& watch);

Path PictureFile(const RunPlan& plan, std::int64_t steps);

}  // namespace tilegrad::train
