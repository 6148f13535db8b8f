// SPDX-License-Identifier: Apache-2.0
// The plan of a call with what it came to: counts and times by stage.
#pragma once

#include <cstdint>

#include "render/pipeline/records.h"
#include "render/shading/plan.h"
#include "render/shading/run.h"

namespace tilegrad {

// What a call did outside of the renderer's own stages, and the milliseconds it took.
struct SceneWork {
  std::int64_t normals = 0;  // faces whose normals were derived
  std::int64_t texels = 0;   // of textures made ready
  std::int64_t packed = 0;   // numbers of streams laid side by side
  double normals_ms = 0, textures_ms = 0, pack_ms = 0, merge_ms = 0;
};

// Of one call. `shade` is 0 where no stage ran.
struct CallWork {
  RenderStats stats;
  RenderTimes times;
  ShadeWork shade;
  SceneWork scene;
};

PlanReport ReportForward(const ForwardPlan& plan, const CallWork& work);
PlanReport ReportBackward(const BackwardPlan& plan, const CallWork& work);

}  // namespace tilegrad
