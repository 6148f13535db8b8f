// SPDX-License-Identifier: Apache-2.0
// How far a shape is from the truth.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "render/picture/picture.h"
#include "train/data/dataset.h"
#include "train/eval/evaluation.h"

namespace tilegrad::train {

// What is compared: both sides normalised to fill the same cube.
struct Shape {
  std::vector<std::uint8_t> occupancy;  // of Voxelize
  std::vector<std::uint8_t> carved;     // of VoxelizeCarved; empty: unknown
  std::vector<glm::vec3> points;        // of the surface; empty: unknown
};

// `seed`: of the points.
Result<Shape> ShapeOf(Mesh mesh, std::uint64_t seed);
// As the dataset keeps it. An error for a mesh without extent.
Result<Shape> TruthShape(const ModelData& data);

Score Compare(const Shape& shape, const Shape& truth);
// Of a prediction that has no shape.
Score WorstScore(const Shape& truth);
// The mean; a measure that is not there in one is not there in the mean.
Score MeanScore(std::span<const Score> scores);

// Score::color_l1 of planar RGBA bytes, [4][pixels] each: sum and count of one picture, added.
struct ColorDifference {
  double sum = 0;
  std::size_t count = 0;
  void Add(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b);
  double Mean() const { return count == 0 ? 0 : sum / static_cast<double>(count); }
};

// Pictures of predictions as a dataset has them of its models: unlit, RGB over black.
class PredictionPictures {
 public:
  PredictionPictures(const DatasetInfo& info, std::vector<int> views);
  // [views][4][size][size].
  Result<std::vector<std::uint8_t>> Draw(const Mesh& mesh);

 private:
  const DatasetInfo& info_;
  std::vector<int> views_;
  std::unique_ptr<Workers> alone_;
  PictureRenderer renderer_;
};

}  // namespace tilegrad::train
