// SPDX-License-Identifier: Apache-2.0
// A fit from start, or from where it stopped, to its end.
//
//   <out>/mesh.glb                the fitted mesh with its texture or colours
//   <out>/transforms_fitted.json  the cameras of all views, as they are at the end
//   <out>/masks/                  masks that were found, if the input had none
//   <out>/report.html             pictures, scores, curves
//   <out>/timelapse/, timelapse.png   pictures over the run, and the mesh at each
//   <out>/metrics.jsonl, tensorboard/, checkpoints/
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "fit/clock.h"
#include "fit/config.h"
#include "fit/doctor.h"
#include "fit/input.h"
#include "fit/score.h"
#include "train/run/run.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

struct FitJob {
  FitConfig config;
  FitInput input;
  std::optional<Mesh> start;  // none: config.start
  std::optional<Mesh> truth;  // to compare with
  // Where cameras start; none: where the input has them, turned as the configuration says.
  std::vector<Camera> start_cameras;
  Path out;
  bool locked = false;  // RunPlan::locked
  ExistingRun existing = ExistingRun::kRefuse;
  WarningSink warn = nullptr;               // broken checkpoints that were passed over
  std::function<Status()> begun = nullptr;  // RunWork::Begin
};

struct FitOutcome : RunOutcome {
  std::vector<Finding> findings;  // of the doctor, at the start
  std::vector<ViewScore> training, held_out;
  std::string doubt;                // what the scores of the fitted views say against it
  std::optional<double> voxel_iou;  // at 32 voxels a side, where a truth is known
  std::optional<double> camera_error_before, camera_error_after;  // degrees, means; if perturbed
};

// As ExecuteRun: a continued fit ends in the bits of one that was not interrupted, for any number
// of workers. Errors say what in the configuration or the input does not fit.
Result<FitOutcome> RunFit(const FitJob& job, const Workers& workers, const ProgressSink& progress,
                          const StopFlag& stop);

// The doctor alone, on all training views at the first step.
Result<std::vector<Finding>> DiagnoseFit(const FitJob& job, const Workers& workers,
                                         const Watch& watch = {});

// The scene that a job starts from, and what its steps need.
struct FitStart {
  FitScene scene;
  FitterOptions options;
  FitConfig config;  // the job's, settled
  std::string note;  // why it is not what one would expect, or empty
};
// Whether a fit starts from the visual hull, unless masks leave the object's distance in doubt.
bool MayStartFromHull(const FitJob& job);
Result<FitStart> PrepareFit(const FitJob& job, const Workers& workers, const Watch& watch = {});
// Whether the configuration can be fitted to the input, as far as that is seen at once.
Status CheckFit(const FitJob& job);

// The input's cameras, turned as the configuration says about `middle`.
std::vector<Camera> TurnedCameras(const FitJob& job, const std::array<float, 3>& middle);

// What shapes the result, as DescribeConfig says it, and the input's size.
std::string DescribeJob(const FitJob& job);

// What people read for the names in its log.
TermLabels FitLabels();
// The page. `sheet` is the timelapse in one picture, or empty.
Result<std::string> FitReport(const FitJob& job, const FitOutcome& outcome, const Mesh& mesh,
                              const ImageU8& sheet);

// Scores the scene at the end of a fit, and writes its files.
class FitResult {
 public:
  FitResult(const FitJob& job, const FitScene& scene, const FitClock& clock, const Workers& workers,
            const Watch& watch)
      : job_(job), scene_(scene), clock_(clock), workers_(workers), watch_(watch) {}
  Status Finish(const RunPlan& plan, FitOutcome* outcome) const;

 private:
  Result<ImageU8> Sheet(const RunPlan& plan) const;
  Status Score(FitOutcome* outcome) const;
  Status WriteCameras() const;

  const FitJob& job_;
  const FitScene& scene_;
  const FitClock& clock_;
  const Workers& workers_;
  const Watch& watch_;
};

}  // namespace tilegrad::train
