// SPDX-License-Identifier: Apache-2.0
// First stage of a frame, per image: scene -> screen -> bins.
#pragma once

#include <cstddef>

#include "render/alpha/stage.h"
#include "render/pipeline/image_scratch.h"
#include "render/pipeline/pixel_stage.h"
#include "render/pipeline/records.h"
#include "render/pipeline/work.h"

namespace tilegrad {

struct PrepareRequest {
  bool drawn_bins = true;       // visibility will run
  AlphaStage* alpha = nullptr;  // alpha or its gradient will run, by this rule
  bool reuse = false;           // what was prepared last, if it was for the same scene and options
};

struct SceneToPrepare {
  std::size_t n;  // of the batch
  const PipelineScene& scene;
  const Topology& topology;  // of its faces
};

// Returns false, and prepares nothing, if a number of the scene is not finite or out of range.
bool PrepareImage(const SceneToPrepare& in, const RenderOptions& options,
                  const PrepareRequest& request, const Workers& workers, ImageScratch* image,
                  RenderStats* stats);

// The attributes that a stage needs again on the way back; null: none. `image` is prepared.
void PrepareRecomputed(const PixelStage* stage, const PipelineScene& scene, std::size_t n,
                       ImageScratch* image);

}  // namespace tilegrad
