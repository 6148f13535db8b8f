// SPDX-License-Identifier: Apache-2.0
// All stages of one tile, forward: visibility, interpolation, alpha.
#pragma once

#include "render/image_scratch.h"
#include "render/renderer.h"

namespace tilegrad {

// Writes the tile's pixels into every image that `frame` has. Returns the error that alpha spent.
double RenderTile(const SceneView& scene, const RenderOptions& options, const ImageScratch& image,
                  const TileTask& task, WorkerScratch* worker, Frame* frame);

}  // namespace tilegrad
