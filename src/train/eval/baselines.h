// SPDX-License-Identifier: Apache-2.0
// Baselines of evaluations: the nearest training picture, which only memorises, and the best single
// shape, which ignores the picture.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad::train {

// Pictures averaged to kThumbnail x kThumbnail, RGBA: small differences of pose matter less, and a
// search takes a sixteenth of the time.
inline constexpr int kThumbnail = 16;

// [4][kThumbnail][kThumbnail] of planar RGBA [4][size][size]; `size` is a multiple of kThumbnail,
// or the mean is over the nearest whole pixels.
std::vector<std::uint8_t> Thumbnail(std::span<const std::uint8_t> image, int size);

class ImageIndex {
 public:
  struct Match {
    int model = 0, view = 0;
    double distance = 0;  // root mean square difference of thumbnails, [0, 1]
  };

  // Pictures [views][4][size][size] of one model; models count from 0 in the order of calls.
  void Add(std::span<const std::uint8_t> images, int views, int size);
  // The first of ties. Needs at least one picture.
  Match Nearest(std::span<const std::uint8_t> image, int size) const;
  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    int model, view;
  };
  std::vector<Entry> entries_;
  std::vector<std::uint8_t> thumbnails_;
  int models_ = 0;
};

// The mean shape of the training models, solid where enough of them are.
struct SingleShape {
  std::vector<std::uint8_t> occupancy;  // in the layout of the grids
  double threshold = 0;                 // a voxel is solid if this share of the grids has it
  double mean_iou = 0;                  // over the grids
};

// Uses the threshold k/256 with the best mean IoU over `grids`, which have one size and hold 0 or
// 1; the lowest of ties. At least one grid.
SingleShape BestSingleShape(std::span<const std::vector<std::uint8_t>> grids);

// The faces between solid and empty voxels of [n][n][n] as a closed mesh in voxel units, outside
// counter-clockwise. The squares share no vertices.
Mesh VoxelSurface(std::span<const std::uint8_t> occupancy, int n);

}  // namespace tilegrad::train
