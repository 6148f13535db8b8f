// SPDX-License-Identifier: Apache-2.0
// Reports the plan of a call with counts and times by stage.
#pragma once

#include <cstdint>

#include "render/pipeline/records.h"
#include "render/shading/plan.h"
#include "render/shading/run.h"

namespace tilegrad {

// Counts of what a call did outside of the pipeline, and milliseconds.
struct SceneWork {
  std::int64_t normals = 0;  // faces whose normals were derived
  std::int64_t texels = 0;   // of prepared textures
  std::int64_t packed = 0;   // packed numbers of streams
  double normals_ms = 0, textures_ms = 0, pack_ms = 0, merge_ms = 0;
};

// Of one call. `shade` is 0 if no stage ran.
struct CallWork {
  RenderStats stats;
  RenderTimes times;
  ShadeWork shade;
  SceneWork scene;
};

PlanReport ReportForward(const ForwardPlan& plan, const CallWork& work);
PlanReport ReportBackward(const BackwardPlan& plan, const CallWork& work);

}  // namespace tilegrad
