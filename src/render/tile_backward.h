// SPDX-License-Identifier: Apache-2.0
// The way back through one tile, from face ids alone; and the merging of tiles, in their order.
#pragma once

#include <span>

#include "render/image_scratch.h"
#include "render/renderer.h"

namespace tilegrad {

// Which adjoints of the screen are wanted.
struct BackwardRequest {
  bool geometry;    // positions or camera
  bool attributes;  // of the mesh
};

// Sums the tile's gradients per face into the worker's lists.
TileGradients RenderTileBackward(const RenderOptions& options, const ImageScratch& image,
                                 const TileTask& task, const Frame& frame,
                                 const FrameGradients& d_frame, const BackwardRequest& request,
                                 std::size_t worker_index, WorkerScratch* worker);

// Adds the gradients of an image's tiles, in order, to its vertices and to d_attributes (in the
// layout of the screen mesh; empty: not wanted).
void MergeTileGradients(const ImageScratch& image, std::span<const TileGradients> tiles,
                        std::span<const WorkerScratch> workers, std::span<float> d_attributes,
                        const raster::ScreenGradients& d_mesh);

}  // namespace tilegrad
