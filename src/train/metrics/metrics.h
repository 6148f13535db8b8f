// SPDX-License-Identifier: Apache-2.0
// The paper's 3D metrics (section 5.1).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"
#include "train/metrics/face_tree.h"

namespace tilegrad::train {

// Solid occupancy of a mesh that is first scaled and moved so that the bounding box of its faces is
// centred in, and its longest side fills, the cube [0, resolution]^3, up to a thousandth of a voxel
// (a surface on a border of voxels belongs to one side only); voxel (i, j, k) has its centre at (i
// + 0.5, j + 0.5, k + 0.5). A voxel is solid if the surface passes through it or if it cannot be
// reached from outside (carving), so soups of open shells have a well-defined inside. Returns
// [x][y][z] of 0 or 1. An error for an invalid mesh or one without extent.
Result<std::vector<std::uint8_t>> Voxelize(const Mesh& mesh, int resolution);

// The paper's rule (binvox -cb -dc -aw), on the same cube: a voxel is empty if an axis-parallel ray
// from outside passes through it and the next voxel without meeting the surface. So the voxel in
// front of the surface stays solid unless another ray carves it, and hollows that no axis-parallel
// ray enters are filled.
Result<std::vector<std::uint8_t>> VoxelizeCarved(const Mesh& mesh, int resolution);

// The rule of N3MR and SoftRas (their `voxelization`), which does not fit the mesh to the cube: it
// scales [-half_extent, half_extent]^3 to resolution - 1 voxels in the cube's middle. Surface
// voxels are those of the vertices and, along each axis, the four around a line through voxel
// corners at the height where it meets a face; a voxel is solid if it cannot be reached from
// outside. An error for an invalid mesh.
Result<std::vector<std::uint8_t>> VoxelizeNmr(const Mesh& mesh, double half_extent, int resolution);

// As Voxelize, for a surface given by points, dense enough that each of its voxels holds one. The
// cube is [-half_extent, half_extent]^3; points outside are ignored.
Result<std::vector<std::uint8_t>> VoxelizePoints(std::span<const glm::vec3> points,
                                                 double half_extent, int resolution);

// |a and b| / |a or b| over voxels that are not 0; 1 if both are empty. The sizes must agree.
double VoxelIou(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b);

// The voxels that a surface passes through, [x][y][z] of 0 or 1. Corners are in voxels: voxel (i,
// j, k) of [0, resolution)^3 is the cube from (i, j, k) to (i + 1, j + 1, k + 1); up to a
// thousandth of one, as above. Ignores what lies outside. An error for a resolution out of range.
Result<std::vector<std::uint8_t>> SurfaceVoxels(std::span<const Triangle> surface, int resolution);

// Points distributed by area, as faces with barycentric weights (deterministic in `seed`). An error
// if the areas' sum is not a positive number.
struct SurfaceSample {
  std::int32_t face;
  std::array<double, 3> weights;
};
Result<std::vector<SurfaceSample>> SampleFaces(std::span<const double> areas, int count,
                                               std::uint64_t seed);

// `count` points distributed by area (deterministic in `seed`). An error if the surface has no
// area.
Result<std::vector<glm::vec3>> SampleSurface(const Mesh& mesh, int count, std::uint64_t seed);

struct SurfaceScore {
  double chamfer = 0;    // mean of the two mean nearest distances
  double precision = 0;  // share of predicted points within the threshold of the truth
  double recall = 0;
  double f_score = 0;  // 2 P R / (P + R), 0 if both are 0
};
// Euclidean nearest neighbours; `threshold` in world units (the paper: 0.02 with the longest side
// 0.9). All zero if one of the two has no points. Coordinates must be finite.
SurfaceScore CompareSurfaces(std::span<const glm::vec3> predicted, std::span<const glm::vec3> truth,
                             double threshold);

// Sharpness of a picture.

// Planes of one picture: [channels][height][width], any range.
struct PlanarPicture {
  std::span<const float> values;
  int channels = 0, height = 0, width = 0;
};

// High-pass energy: the mean over channels and counted pixels of (I - B I)^2, where B is the
// binomial filter (1 2 1)^T (1 2 1) / 16. A pixel counts if its whole 3x3 window lies in the
// picture and, if `covered` [height][width] is given, is non-zero there: the sharp outline of a
// blurred texture does not count. 0 for a constant picture and where no pixel counts; m^2 for a
// chequerboard of +m and -m. Compare it with the truth's on the truth's pixels: a lower value means
// blur, a higher one noise. InvalidArgument: inconsistent sizes, or a number that is not finite.
Result<double> HighPassEnergy(const PlanarPicture& picture,
                              std::span<const std::uint8_t> covered = {});

// PCK: the percentage of correct keypoints, as CMR counts it.

// A keypoint is correct if its error is below `threshold`, in units of the longer side of the
// object's box.
class KeypointScore {
 public:
  KeypointScore(std::size_t keypoints, double threshold)
      : threshold_(threshold), right_(keypoints), seen_(keypoints) {}
  // A visible keypoint.
  void Add(std::size_t keypoint, double error) {
    ++seen_[keypoint];
    right_[keypoint] += error < threshold_ ? 1 : 0;
  }
  // Mean over the keypoints seen of each one's share of correct predictions; nullopt if none was
  // seen.
  std::optional<double> Mean() const {
    double sum = 0, count = 0;
    for (std::size_t k = 0; k < seen_.size(); ++k) {
      if (seen_[k] == 0) continue;
      sum += static_cast<double>(right_[k]) / static_cast<double>(seen_[k]);
      count += 1;
    }
    return count > 0 ? std::optional(sum / count) : std::nullopt;
  }

 private:
  double threshold_;
  std::vector<std::int64_t> right_, seen_;
};

}  // namespace tilegrad::train
