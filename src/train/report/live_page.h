// SPDX-License-Identifier: Apache-2.0
// What a page shows of a run or a fit while it goes on, or afterwards: read from the files in its
// folder and from nothing else, so that it is the same for one that was killed.
//
// Pictures are samples/step_N.png or timelapse/N.png; meshes timelapse/N.glb, or else what the
// newest checkpoint predicts for the first example of a report.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"

namespace tilegrad::train {

struct LiveSource {
  Path run;                // folder of a run or a fit; it may still be empty
  Path data = {};          // dataset of a run, for what it predicts; empty: no meshes
  std::int64_t steps = 0;  // of the whole work; 0: as config.toml says, if there is one
};

// Functions may be called from several threads. Errors name the file.
class LiveRun {
 public:
  explicit LiveRun(LiveSource source) : source_(std::move(source)) {}

  // JSON: name, running, step, steps (0: not known), curves and charts as CurveData has them,
  // pictures and meshes: the steps that there are some of.
  Result<std::string> State();
  // JSON: mesh and truth as MeshJson has them, in the middle of a cube of side 0.9; null: there is
  // none. NotFound: no mesh of that step.
  Result<std::string> Mesh(std::int64_t step);
  // PNG. NotFound: no picture of that step.
  Result<Bytes> Picture(std::int64_t step) const;

 private:
  Result<std::string> Predicted(std::int64_t step);

  LiveSource source_;
  std::mutex mutex_;
  std::int64_t predicted_step_ = -1;
  std::string predicted_;  // of that step: a prediction takes a moment
};

// The page that asks for `state`, `mesh?step=N` and `picture?step=N`.
Result<std::string> LivePage();

}  // namespace tilegrad::train
