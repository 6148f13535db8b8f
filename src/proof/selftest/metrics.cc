// SPDX-License-Identifier: Apache-2.0
// Scores of meshes whose scores are known.
#include "train/metrics/metrics.h"

#include "proof/selftest/check.h"
#include "scene/shapes.h"

namespace tilegrad::selftest {
namespace {

constexpr int kVoxels = 32;

Status ExpectScore(const CheckContext& context, const std::string& what, double got, double want) {
  std::vector<double> score = {got};
  context.Take(what, score);
  if (score[0] == want) return {};
  return InternalError("{} is {}, expected {}", what, score[0], want);
}

// The faces of the rod lie in the middle of voxels: 15 of 32 wide, it passes through 16 x 16 in
// each layer, and the cube fills them all.
Result<Finding> Iou(const CheckContext& context) {
  TILEGRAD_ASSIGN(const auto torus, train::Voxelize(Torus(1, 0.4f, 24, 12), kVoxels));
  TILEGRAD_ASSIGN(const auto cube, train::Voxelize(Box({0, 0, 0}, {1, 1, 1}), kVoxels));
  TILEGRAD_ASSIGN(const auto rod,
                  train::Voxelize(Box({0, 0, 0}, {1, 0.46875f, 0.46875f}), kVoxels));
  TILEGRAD_TRY(ExpectScore(context, "IoU of a torus and itself", train::VoxelIou(torus, torus), 1));
  TILEGRAD_TRY(ExpectScore(context, "IoU of a rod and a cube", train::VoxelIou(rod, cube), 0.25));
  return Finding{"1 of a mesh and itself, 1/4 of a rod and a cube"};
}

// Two squares of points, one 1/8 above the other: the nearest point is the one above.
Result<Finding> Surfaces(const CheckContext& context) {
  TILEGRAD_ASSIGN(const auto points, train::SampleSurface(Torus(1, 0.4f, 24, 12), 2000, 17));
  const auto same = train::CompareSurfaces(points, points, 0.02);
  TILEGRAD_TRY(ExpectScore(context, "F-score of a mesh and itself", same.f_score, 1));
  TILEGRAD_TRY(ExpectScore(context, "Chamfer distance of a mesh and itself", same.chamfer, 0));
  std::vector<glm::vec3> low, high;
  for (int i = 0; i < 100; ++i) {
    low.emplace_back(i / 10, i % 10, 0);
    high.emplace_back(i / 10, i % 10, 0.125f);
  }
  const auto far = train::CompareSurfaces(low, high, 0.1),
             near = train::CompareSurfaces(low, high, 0.2);
  TILEGRAD_TRY(ExpectScore(context, "Chamfer distance of two squares", far.chamfer, 0.125));
  TILEGRAD_TRY(ExpectScore(context, "F-score of two squares, too far", far.f_score, 0));
  TILEGRAD_TRY(ExpectScore(context, "F-score of two squares, near", near.f_score, 1));
  return Finding{"F-score 1 and Chamfer 0 of a mesh and itself"};
}

}  // namespace

std::vector<Check> MetricChecks() {
  return {{"metrics: 3D IoU", Iou}, {"metrics: F-score and Chamfer distance", Surfaces}};
}

}  // namespace tilegrad::selftest
