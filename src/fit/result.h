// SPDX-License-Identifier: Apache-2.0
// What a fit leaves behind when it is over.
#pragma once

#include <vector>

#include "fit/clock.h"
#include "fit/run.h"
#include "train/run/run.h"

namespace tilegrad::train {

// The scene at the end, its scores and what is written of both.
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
