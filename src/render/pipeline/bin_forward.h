// SPDX-License-Identifier: Apache-2.0
// All stages forward: a bin is drawn, then its tiles are interpolated and given their alpha.
#pragma once

#include "render/alpha/stage.h"
#include "render/pipeline/image_scratch.h"
#include "render/pipeline/pixel_stage.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// What the bins of an image have in common.
struct BinInput {
  const PipelineScene& scene;
  const RenderOptions& options;
  const ImageScratch& image;
  PixelStage* stage;  // null: attributes are images themselves
  AlphaStage* alpha;  // null: not wanted
};

// Writes the bin's pixels into every image that `frame` has. Returns the error that alpha spent.
// task.bin and task.rect are those of raster::BinGrid.
double RenderBin(const BinInput& input, const BinTask& task, WorkerScratch* worker,
                 PipelineFrame* frame);

}  // namespace tilegrad
