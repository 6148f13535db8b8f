// SPDX-License-Identifier: Apache-2.0
// All stages forward: a bin is drawn, then its tiles are interpolated and given their alpha.
#pragma once

#include "render/image_scratch.h"
#include "render/renderer.h"

namespace tilegrad {

// Writes the bin's pixels into every image that `frame` has. Returns the error that alpha spent.
// task.tile and task.rect are those of raster::BinGrid.
double RenderBin(const SceneView& scene, const RenderOptions& options, const ImageScratch& image,
                 const TileTask& task, WorkerScratch* worker, Frame* frame);

}  // namespace tilegrad
