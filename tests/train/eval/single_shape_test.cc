// SPDX-License-Identifier: Apache-2.0
#include "train/eval/single_shape.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <map>

#include "base/rng.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train::single_shape_test {

using Grid = std::vector<std::uint8_t>;

TEST(SingleShape, OfOneGridIsThatGrid) {
  const std::vector<Grid> grids = {{1, 0, 0, 1, 1, 0}};
  const SingleShape shape = BestSingleShape(grids);
  EXPECT_EQ(shape.occupancy, grids[0]);
  EXPECT_DOUBLE_EQ(shape.mean_iou, 1);
}

TEST(SingleShape, NoThresholdIsBetter) {
  Rng rng(1);
  std::vector<Grid> grids(9, Grid(200));
  for (auto& grid : grids) {
    for (std::size_t i = 0; i < grid.size(); ++i) {
      grid[i] = rng.Uniform() < static_cast<double>(i) / 200.0;
    }
  }
  const auto mean_iou = [&](const Grid& shape) {
    double sum = 0;
    for (const auto& grid : grids) sum += VoxelIou(shape, grid);
    return sum / 9;
  };
  double best = 0;
  for (int votes = 1; votes <= 9; ++votes) {
    Grid shape(200);
    for (std::size_t i = 0; i < shape.size(); ++i) {
      int count = 0;
      for (const auto& grid : grids) count += grid[i];
      shape[i] = count >= votes;
    }
    best = std::max(best, mean_iou(shape));
  }
  const SingleShape shape = BestSingleShape(grids);
  EXPECT_DOUBLE_EQ(shape.mean_iou, best);
  EXPECT_DOUBLE_EQ(mean_iou(shape.occupancy), best);
}

// The signed volume (divergence theorem) is the number of voxels only if all faces look outwards
// and nothing is missing.
TEST(VoxelSurface, EnclosesTheVoxels) {
  Rng rng(2);
  const int n = 5;
  Grid grid(static_cast<std::size_t>(n * n * n));
  int solid = 0;
  for (auto& voxel : grid) solid += voxel = rng.Uniform() < 0.4;
  const Mesh mesh = VoxelSurface(grid, n);
  ASSERT_TRUE(Validate(mesh).ok());
  double volume = 0;
  glm::dvec3 closed(0);  // the sum of area vectors of a closed surface is zero
  for (const Face& face : mesh.faces) {
    glm::dvec3 p[3];
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = glm::dvec3(mesh.positions[static_cast<std::size_t>(face[k])]);
    }
    volume += glm::dot(p[0], glm::cross(p[1], p[2])) / 6;
    closed += glm::cross(p[1] - p[0], p[2] - p[0]);
  }
  EXPECT_NEAR(volume, solid, 1e-9);
  EXPECT_NEAR(glm::length(closed), 0, 1e-9);
}

TEST(VoxelSurface, OneVoxelIsACube) {
  Grid grid(27, 0);
  grid[13] = 1;
  const Mesh mesh = VoxelSurface(grid, 3);
  EXPECT_EQ(mesh.faces.size(), 12u);
  const Bounds bounds = MeshBounds(mesh);
  EXPECT_EQ(bounds.low, glm::vec3(1));
  EXPECT_EQ(bounds.high, glm::vec3(2));
}

}  // namespace tilegrad::train::single_shape_test
