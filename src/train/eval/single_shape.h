// SPDX-License-Identifier: Apache-2.0
// The best answer that does not look at the image: the mean shape of the training models.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

struct SingleShape {
  std::vector<std::uint8_t> occupancy;  // as the grids it was made of
  double threshold = 0;                 // a voxel is solid if this share of the grids has it
  double mean_iou = 0;                  // over the grids
};

// Of all thresholds k/256 the one with the best mean IoU over `grids`, which have one size and hold
// 0 or 1; the lowest of equals. At least one grid.
SingleShape BestSingleShape(std::span<const std::vector<std::uint8_t>> grids);

// The faces between solid and empty voxels of [n][n][n] as a closed mesh in voxel units, outside
// counter-clockwise. Every solid voxel brings its own corners.
Mesh VoxelSurface(std::span<const std::uint8_t> occupancy, int n);

}  // namespace tilegrad::train
