// SPDX-License-Identifier: Apache-2.0
#include "train/eval/baselines.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include "base/rng.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train::baselines_test {

std::vector<std::uint8_t> Flat(std::uint8_t value, int size) {
  return std::vector<std::uint8_t>(std::size_t{4} * static_cast<std::size_t>(size * size), value);
}

TEST(ImageIndex, FindsTheNearestAndSaysHowFarItIs) {
  ImageIndex index;
  std::vector<std::uint8_t> two = Flat(10, 32), more = Flat(200, 32);
  two.insert(two.end(), more.begin(), more.end());
  index.Add(two, 2, 32);
  index.Add(Flat(100, 32), 1, 32);
  EXPECT_EQ(index.size(), 3u);
  const auto match = index.Nearest(Flat(190, 64), 64);  // of another size
  EXPECT_EQ(match.model, 0);
  EXPECT_EQ(match.view, 1);
  EXPECT_NEAR(match.distance, 10 / 255.0, 1e-9);
  EXPECT_EQ(index.Nearest(Flat(100, 16), 16).model, 1);
  EXPECT_EQ(index.Nearest(Flat(100, 16), 16).distance, 0);
}

TEST(ImageIndex, ThumbnailsAreMeans) {
  std::vector<std::uint8_t> image = Flat(0, 32);
  image[0] = 255;
  image[1] = 1;  // two of the four pixels of the first mean: 64
  const auto small = Thumbnail(image, 32);
  EXPECT_EQ(small.size(), 4u * 16 * 16);
  EXPECT_EQ(small[0], 64);
  EXPECT_EQ(small[1], 0);
  EXPECT_EQ(Thumbnail(Flat(7, 5), 5), std::vector<std::uint8_t>(4 * 256, 7));  // fewer than it has
}

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

}  // namespace tilegrad::train::baselines_test
