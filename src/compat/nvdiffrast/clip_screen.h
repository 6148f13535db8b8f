// SPDX-License-Identifier: Apache-2.0
// Faces in clip space to the screen of the engine's rasterizer (raster/screen_mesh.h), which finds
// what is seen.
//
// Faces are cut by the planes -w <= z <= w, and at a guard far outside of the image on each side,
// so that what remains has w > 0 and coordinates of at most raster::kGuardBand. Where an edge is
// cut depends on its two ends only: faces that share it stay together. Row 0 of the screen is row 0
// of the image, the bottom. In the place of 1/depth stands 1 - z/w: linear on the screen too, and
// larger where it is nearer.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/aligned.h"
#include "compat/nvdiffrast/clip_mesh.h"
#include "compat/nvdiffrast/pixel_grid.h"
#include "raster/screen_mesh.h"

namespace tilegrad::compat::nvdiffrast {

// Faces [first, first + count).
struct FaceRange {
  std::size_t first, count;
};

// Reused from frame to frame.
struct ClipScreen {
  raster::ScreenMeshBuffers mesh;
  AlignedVector<std::uint8_t> outside;  // of each vertex: planes that it lies beyond
};

// `source_face` of the mesh counts all of `faces`. Positions are finite and `faces` have been
// checked. Allocates only to grow `out`.
template <class T>
void MakeClipScreen(const VertexRows<T>& positions, FaceList faces, const FaceRange& range,
                    std::size_t image, const PixelGrid& grid, ClipScreen* out);

}  // namespace tilegrad::compat::nvdiffrast
