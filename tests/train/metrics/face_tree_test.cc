// SPDX-License-Identifier: Apache-2.0
// Nearest faces against every face and against a fine grid of weights; enclosure against shapes.
#include "train/metrics/face_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numeric>
#include <vector>

#include "base/rng.h"
#include "scene/shapes.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train::face_tree_test {

using glm::dvec3;

dvec3 RandomPoint(Rng* rng) {
  return {rng->Uniform(-1, 1), rng->Uniform(-1, 1), rng->Uniform(-1, 1)};
}

std::vector<Triangle> Soup(int count, double size, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<Triangle> faces;
  for (int i = 0; i < count; ++i) {
    const dvec3 centre = RandomPoint(&rng);
    faces.push_back({centre + size * RandomPoint(&rng), centre + size * RandomPoint(&rng),
                     centre + size * RandomPoint(&rng)});
  }
  return faces;
}

std::vector<Triangle> FacesOf(const Mesh& mesh) {
  std::vector<Triangle> faces;
  for (const Face& f : mesh.faces) {
    Triangle& face = faces.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      face[k] = dvec3(mesh.positions[static_cast<std::size_t>(f[k])]);
    }
  }
  return faces;
}

dvec3 PointOf(const Triangle& face, const std::array<double, 3>& w) {
  return w[0] * face[0] + w[1] * face[1] + w[2] * face[2];
}

TEST(FaceTree, FindsTheNearestOfAllFaces) {
  const auto faces = Soup(200, 0.2, 1);
  const FaceTree tree(faces);
  Rng rng(2);
  for (int i = 0; i < 300; ++i) {
    const dvec3 query = 1.5 * RandomPoint(&rng);
    const auto found = tree.Find(query);
    FaceTree::Nearest best;
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const auto alone = FaceTree(std::span(&faces[f], 1)).Find(query);
      if (alone.squared < best.squared) {
        best = alone;
        best.face = static_cast<std::int32_t>(f);
      }
    }
    EXPECT_EQ(found.face, best.face);
    EXPECT_EQ(found.squared, best.squared);
    const dvec3 at = PointOf(faces[static_cast<std::size_t>(found.face)], found.weights);
    EXPECT_NEAR(glm::distance(at, query), std::sqrt(found.squared), 1e-14);
  }
}

TEST(FaceTree, NoPointOfAFaceIsNearer) {
  Rng rng(3);
  constexpr int kSteps = 40;
  for (const Triangle& face : Soup(60, 1, 4)) {
    const dvec3 query = 2.0 * RandomPoint(&rng);
    const auto found = FaceTree(std::span(&face, 1)).Find(query);
    for (int a = 0; a <= kSteps; ++a) {
      for (int b = 0; a + b <= kSteps; ++b) {
        const double u = double(a) / kSteps, v = double(b) / kSteps;
        const dvec3 offset = PointOf(face, {1 - u - v, u, v}) - query;
        EXPECT_GE(glm::dot(offset, offset), found.squared - 1e-13);
      }
    }
  }
}

TEST(FaceTree, FacesWithoutArea) {
  const std::vector<Triangle> faces = {{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}},
                                       {{{1, 0, 0}, {3, 0, 0}, {2, 0, 0}}}};
  const FaceTree tree(faces);
  EXPECT_EQ(tree.Find({-1, 0, 0}).face, 0);
  EXPECT_EQ(tree.Find({2.5, 1, 0}).face, 1);
  EXPECT_EQ(tree.Find({2.5, 1, 0}).squared, 1);
  EXPECT_EQ(FaceTree({}).Find({0, 0, 0}).face, -1);
}

TEST(FaceTree, OfEqualFacesTheFirst) {
  std::vector<Triangle> faces = Soup(1, 1, 5);
  faces.resize(20, faces[0]);
  EXPECT_EQ(FaceTree(faces).Find({3, 3, 3}).face, 0);
}

// Points in the planes of vertices and edges are the hard ones: rays hit them exactly.
TEST(FaceTree, EnclosesABoxAndNothingElse) {
  const auto faces = FacesOf(Box({0, 0, 0}, {2, 2, 2}));
  const FaceTree tree(faces);
  for (int x = -6; x <= 6; ++x) {
    for (int y = -6; y <= 6; ++y) {
      for (int z = -6; z <= 6; ++z) {
        const auto most = std::max({std::abs(x), std::abs(y), std::abs(z)});
        if (most == 4) continue;  // on the surface
        EXPECT_EQ(tree.Encloses(dvec3(x, y, z) * 0.25), most < 4) << x << ' ' << y << ' ' << z;
      }
    }
  }
}

TEST(FaceTree, EnclosesATorusButNotItsHole) {
  const auto faces = FacesOf(Torus(1, 0.4f, 96, 48));
  const FaceTree tree(faces);
  // The axis of the torus is that in which its box is shortest.
  dvec3 low = faces[0][0], high = low;
  for (const Triangle& f : faces) {
    low = glm::min(low, f[0]);
    high = glm::max(high, f[0]);
  }
  const dvec3 size = high - low;
  const int axis = size.x < size.y ? 0 : size.y < size.z ? 1 : 2;
  Rng rng(6);
  int inside = 0;
  for (int i = 0; i < 3000; ++i) {
    const dvec3 p = 1.6 * RandomPoint(&rng);
    const double along = p[axis], across = std::sqrt(glm::dot(p, p) - along * along);
    const double from_ring = std::hypot(across - 1, along);
    if (std::abs(from_ring - 0.4) < 0.01) continue;  // the polyhedron is not round
    EXPECT_EQ(tree.Encloses(p), from_ring < 0.4) << p.x << ' ' << p.y << ' ' << p.z;
    inside += from_ring < 0.4;
  }
  EXPECT_GT(inside, 200);
}

// Solid occupancy and surface samples.

int Count(const std::vector<std::uint8_t>& grid) {
  return std::accumulate(grid.begin(), grid.end(), 0);
}

bool At(const std::vector<std::uint8_t>& grid, int x, int y, int z) {
  return grid[static_cast<std::size_t>((x * 32 + y) * 32 + z)] != 0;
}

TEST(Voxelize, ABoxFillsItsVoxelsAndNoMore) {
  // 2 : 1 : 1/2, so that its sides lie on borders of voxels: 32 x 16 x 8. One side of each pair of
  // borders in the middle may touch the next voxel (voxelize.cc), hence one layer at most.
  const auto grid = Voxelize(Box({5, -3, 2}, {4, 2, 1}), 32).value();
  EXPECT_GE(Count(grid), 32 * 16 * 8);
  EXPECT_LE(Count(grid), 32 * 17 * 9);
  EXPECT_TRUE(At(grid, 0, 8, 12));
  EXPECT_TRUE(At(grid, 31, 23, 19));
  EXPECT_TRUE(At(grid, 16, 16, 16));
  EXPECT_FALSE(At(grid, 16, 6, 16));
  EXPECT_FALSE(At(grid, 16, 16, 21));
}

TEST(Voxelize, ASphereHasItsVolumeAndTheSurfaceLayer) {
  const auto grid = Voxelize(Icosphere(4, 1.0f), 32).value();
  // Voxels touched by or inside a ball of radius 16: between the ball and the ball grown by the
  // diagonal of a voxel.
  const double pi = std::acos(-1.0);
  EXPECT_GT(Count(grid), 4.0 / 3 * pi * std::pow(15.9, 3));
  EXPECT_LT(Count(grid), 4.0 / 3 * pi * std::pow(16 + std::sqrt(3.0), 3));
  EXPECT_TRUE(At(grid, 16, 16, 16));
  EXPECT_FALSE(At(grid, 1, 1, 1));
}

TEST(Voxelize, MovingAndScalingChangeNothing) {
  Mesh mesh = Torus(1, 0.4f, 24, 12);
  const auto grid = Voxelize(mesh, 32).value();
  // A power of two and exact sums: the same numbers after normalisation but for one rounding.
  Transform(mesh, {glm::vec3(4, 0, 0), {0, 4, 0}, {0, 0, 4}}, {64, 32, -16});
  EXPECT_GT(VoxelIou(grid, Voxelize(mesh, 32).value()), 0.999);
  EXPECT_FALSE(At(grid, 16, 4, 16));  // its hole, along y
}

// 2 * 0.38 of a cube of 31 voxels: from 4.22 to 27.78, the voxels 4 to 27. Without the scale of 31
// it would be 3 to 28.
TEST(Voxelize, NmrLeavesHalfAVoxelAroundTheCube) {
  const auto grid = VoxelizeNmr(Box({0, 0, 0}, {0.76f, 0.76f, 0.76f}), 0.5, 32).value();
  EXPECT_EQ(Count(grid), 24 * 24 * 24);
  EXPECT_TRUE(At(grid, 4, 4, 4));
  EXPECT_TRUE(At(grid, 27, 27, 27));
  // Where a mesh stands counts: it is not moved into the middle.
  const auto moved = VoxelizeNmr(Box({0.125f, 0, 0}, {0.76f, 0.76f, 0.76f}), 0.5, 32).value();
  EXPECT_FALSE(At(moved, 4, 16, 16));
  EXPECT_TRUE(At(moved, 31, 16, 16));
  // A face between two lines through corners of voxels is not seen across them; one that meets
  // them marks the four voxels around each.
  const auto thin = VoxelizeNmr(Box({0, 0, 0}, {0.76f, 0.76f, 0.001f}), 0.5, 32).value();
  EXPECT_EQ(Count(thin), 2 * 24 * 24);
}

TEST(Voxelize, DensePointsAreASurface) {
  const Mesh ball = Icosphere(4, 0.5f);
  const auto points = SampleSurface(ball, 100000, 1).value();
  const auto grid = VoxelizePoints(points, 0.5, 32).value();
  EXPECT_GT(VoxelIou(grid, Voxelize(ball, 32).value()), 0.98);  // corners of voxels hold no point
  EXPECT_TRUE(At(grid, 16, 16, 16));
}

TEST(Voxelize, AnOpenShellIsNotFilled) {
  Mesh box = Box({0, 0, 0}, {1, 1, 1});
  const auto closed = Voxelize(box, 32).value();
  EXPECT_EQ(Count(closed), 32 * 32 * 32);
  box.faces.resize(box.faces.size() - 2);  // one side taken away
  const auto open = Voxelize(box, 32).value();
  EXPECT_LT(Count(open), 6 * 32 * 32);
  EXPECT_FALSE(At(open, 16, 16, 16));
}

// Carved, by hand: above and below the plate one voxel is left standing where rays along its normal
// stop early, unless a ray along the plate takes it; those rays meet nothing there.
TEST(Voxelize, APlateIsOneVoxelThick) {
  Mesh plate;
  plate.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}};
  plate.faces = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_EQ(Count(Voxelize(plate, 32).value()), 32 * 32);
  EXPECT_EQ(Count(VoxelizeCarved(plate, 32).value()), 32 * 32);
}

// A box without its top: rays from above see its inside, down to one voxel above the floor, which
// no ray from the side can take. Voxelize leaves the floor alone.
TEST(VoxelizeCarved, LeavesOneVoxelBeforeWhatItSees) {
  Mesh box = Box({0, 0, 0}, {1, 1, 1});
  std::erase_if(box.faces, [&](const Face& f) {
    return std::all_of(f.begin(), f.end(), [&](std::int32_t v) {
      return box.positions[static_cast<std::size_t>(v)].y > 0;
    });
  });
  ASSERT_EQ(box.faces.size(), 10u);
  const auto reached = Voxelize(box, 32).value(), carved = VoxelizeCarved(box, 32).value();
  EXPECT_FALSE(At(reached, 16, 1, 16));
  EXPECT_TRUE(At(carved, 16, 0, 16));
  EXPECT_TRUE(At(carved, 16, 1, 16));
  EXPECT_FALSE(At(carved, 16, 2, 16));
  // Walls are one voxel thick: rays from above pass beside them, whose one voxel of distance is
  // along the ray.
  EXPECT_TRUE(At(carved, 0, 16, 16));
  EXPECT_FALSE(At(carved, 1, 16, 16));
}

TEST(VoxelizeCarved, AClosedBoxIsFull) {
  const Mesh mesh = Box({0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(VoxelizeCarved(mesh, 32).value(), Voxelize(mesh, 32).value());
  EXPECT_EQ(Count(VoxelizeCarved(mesh, 32).value()), 32 * 32 * 32);
}

TEST(Voxelize, BadMeshesAreErrors) {
  EXPECT_FALSE(Voxelize(Mesh{}, 32).ok());
  Mesh point = Icosphere(0, 1.0f);
  EXPECT_FALSE(Voxelize(point, 0).ok());
  EXPECT_FALSE(Voxelize(point, 1 << 20).ok());
  for (auto& p : point.positions) p = glm::vec3(1);
  EXPECT_FALSE(Voxelize(point, 32).ok());
  EXPECT_FALSE(VoxelizeCarved(point, 32).ok());
  point.positions[0].x = std::nanf("");
  EXPECT_FALSE(Voxelize(point, 32).ok());
  EXPECT_FALSE(VoxelizeCarved(point, 32).ok());
}

TEST(SampleSurface, PointsLieOnTheSurfaceByArea) {
  // A unit square and one of three times the area beside it.
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                    {2, 0, 0}, {5, 0, 0}, {5, 1, 0}, {2, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  const int n = 20000;
  const auto points = SampleSurface(mesh, n, 3).value();
  int small = 0;
  double x = 0, y = 0;
  for (const auto& p : points) {
    EXPECT_EQ(p.z, 0);
    const bool first = p.x <= 1;
    EXPECT_TRUE(first || p.x >= 2);
    if (!first) continue;
    ++small;
    x += p.x;
    y += p.y;
  }
  // Five standard deviations: sqrt(n p (1 - p)) of the count, 1 / sqrt(12 m) of a mean.
  EXPECT_NEAR(small, n / 4, 5 * std::sqrt(n * 0.25 * 0.75));
  EXPECT_NEAR(x / small, 0.5, 5 / std::sqrt(12.0 * small));
  EXPECT_NEAR(y / small, 0.5, 5 / std::sqrt(12.0 * small));
}

TEST(SampleSurface, SeedDecidesAndBadMeshesAreErrors) {
  const Mesh ball = Icosphere(2, 1.0f);
  EXPECT_EQ(SampleSurface(ball, 50, 1).value(), SampleSurface(ball, 50, 1).value());
  EXPECT_NE(SampleSurface(ball, 50, 1).value(), SampleSurface(ball, 50, 2).value());
  EXPECT_TRUE(SampleSurface(ball, 0, 1).value().empty());
  EXPECT_FALSE(SampleSurface(ball, -1, 1).ok());
  Mesh flat = ball;
  for (auto& p : flat.positions) p = glm::vec3(1);
  EXPECT_FALSE(SampleSurface(flat, 5, 1).ok());
  EXPECT_FALSE(SampleSurface(Mesh{}, 5, 1).ok());
}

TEST(SurfaceVoxels, MarksWhatAFacePassesThrough) {
  // In the plane z = 1.5 of a grid of 4: the half of the square [0, 2]^2 below its diagonal.
  const Triangle half = {{{0, 0, 1.5}, {1.9, 0, 1.5}, {0, 1.9, 1.5}}};
  const auto grid = SurfaceVoxels(std::vector<Triangle>{half}, 4).value();
  EXPECT_EQ(Count(grid), 3);
  for (const auto& [x, y] : {std::array{0, 0}, std::array{1, 0}, std::array{0, 1}}) {
    EXPECT_EQ(grid[static_cast<std::size_t>((x * 4 + y) * 4 + 1)], 1) << x << y;
  }
}

TEST(SurfaceVoxels, LeavesOutWhatLiesOutside) {
  const Triangle far = {{{-3, 1, 1}, {-1, 2, 1}, {-2, 1, 3}}},
                 beyond = {{{1, 1, 9}, {2, 1, 9}, {1, 2, 1e30}}};
  EXPECT_EQ(Count(SurfaceVoxels(std::vector<Triangle>{far, beyond}, 4).value()), 0);
  const Triangle through = {{{-3, 1.5, 1.5}, {9, 1.5, 1.5}, {9, 1.6, 1.5}}};
  EXPECT_EQ(Count(SurfaceVoxels(std::vector<Triangle>{through}, 4).value()), 4);
  EXPECT_FALSE(SurfaceVoxels(std::vector<Triangle>{through}, 0).ok());
  EXPECT_FALSE(SurfaceVoxels(std::vector<Triangle>{through}, 513).ok());
}

TEST(SurfaceVoxels, ASurfaceOnABorderMarksOneSide) {
  const Triangle border = {{{0.25, 0.25, 2}, {0.75, 0.25, 2}, {0.25, 0.75, 2}}};
  EXPECT_EQ(Count(SurfaceVoxels(std::vector<Triangle>{border}, 4).value()), 1);
}

}  // namespace tilegrad::train::face_tree_test
