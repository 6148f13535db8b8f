// SPDX-License-Identifier: Apache-2.0
// Scratch of a Renderer: what is kept per image of the batch and per worker. Everything grows to
// its largest use and stays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "raster/attributes.h"
#include "raster/bin.h"
#include "raster/drawn_faces.h"
#include "raster/interpolate.h"
#include "raster/near_clip.h"
#include "raster/screen_mesh.h"
#include "raster/soft_mask.h"
#include "raster/tile_faces.h"
#include "raster/visibility.h"
#include "render/renderer.h"

namespace tilegrad {

// What an ImageScratch was made from, to see whether it still fits: a backward pass mostly follows
// the forward pass of the same scenes.
struct PreparedFrom {
  bool valid = false, drawn_bins = false, soft_bins = false;
  AlignedVector<float> positions;
  AlignedVector<std::int32_t> faces;
  CameraT<float> camera;
  int width = 0, height = 0;
  double delta = 0, max_alpha_error = 0;
  FaceCulling culling = FaceCulling::kNone;
};

// A scene on the screen, ready for its tiles.
struct ImageScratch {
  raster::ScreenMeshBuffers buffers;
  raster::ScreenMesh mesh;
  AlignedVector<float> clipped_attributes;
  raster::AttributeViewT<const float> attributes;  // in the layout of `mesh`
  raster::DrawnFaces drawn_faces;
  raster::TileListBuffers drawn_buffers, soft_buffers;
  raster::TileLists drawn, soft;
  raster::SoftMaskPlan soft_plan;
  PreparedFrom prepared;

  // Backward: gradients in the layout of `mesh`.
  AlignedVector<float> d_x, d_y, d_inverse_depth, d_clip_t, d_attributes;
  AlignedVector<raster::CameraPoint<float>> points;
};

// Gradients of one tile's faces: `count` faces, and arrays of `stride` numbers, in a worker's
// lists.
struct FaceGradientBlock {
  std::size_t face_begin = 0, value_begin = 0;
  std::size_t count = 0;
  std::size_t stride = 0;  // of their arrays
};
struct TileGradients {
  std::size_t worker = 0;
  FaceGradientBlock interpolated;  // as InterpolateTileBackward writes them
  FaceGradientBlock soft;          // as SoftMaskBackward writes them
};

struct WorkerScratch {
  raster::VisibilityBin bin;
  raster::VisibilityTile visibility;
  raster::TileFaces faces;
  raster::TileQuads quads;
  raster::TilePlanes planes;
  raster::SoftMaskScratch soft;
  // Lists that the TileGradients of this worker's tiles point into.
  AlignedVector<std::int32_t> gradient_faces;
  AlignedVector<float> gradient_values;

  void ClearGradients() { gradient_faces.clear(), gradient_values.clear(); }
};

// One tile of one image of the batch.
struct TileTask {
  std::size_t image, tile;
  raster::TileRect rect;
};

// The tile's share of the soft mask; face_ids [H,W] of its image.
inline raster::SoftMaskTile SoftTileOf(const ImageScratch& image, const TileTask& task,
                                       std::span<const std::int32_t> face_ids) {
  const auto near = image.soft[task.tile];
  return {task.rect, near, raster::BinnedError(image.soft_plan, near.size()), face_ids};
}

}  // namespace tilegrad
