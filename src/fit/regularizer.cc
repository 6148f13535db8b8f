// SPDX-License-Identifier: Apache-2.0
#include "fit/regularizer.h"

#include "train/losses/laplacian.h"

namespace tilegrad::train {

Regularizer::Regularizer(std::span<const std::int32_t> faces, std::span<const float> start)
    : start_(start.begin(), start.end()),
      movement_(start.size()),
      residual_(start.size()),
      d_movement_(start.size()) {
  for (std::size_t i = 0; i < faces.size(); i += 3) {
    faces_.push_back({faces[i], faces[i + 1], faces[i + 2]});
  }
  topology_ = std::make_unique<Topology>(BuildTopology(faces_, start.size() / 3));
}

double Regularizer::AddLaplacian(float weight, std::span<const float> positions,
                                 std::span<float> d_positions) {
  for (std::size_t i = 0; i < start_.size(); ++i) movement_[i] = positions[i] - start_[i];
  const double loss = LaplacianForward<float>(*topology_, movement_, residual_);
  LaplacianBackward<float>(*topology_, residual_, weight, d_movement_);
  for (std::size_t i = 0; i < start_.size(); ++i) d_positions[i] += d_movement_[i];
  return loss;
}

RegularizerTerms Regularizer::Add(const RegularizerTerms& weights, std::span<const float> positions,
                                  std::span<float> d_positions) {
  RegularizerTerms value;
  if (weights.laplacian > 0) {
    value.laplacian = AddLaplacian(static_cast<float>(weights.laplacian), positions, d_positions);
  }
  if (weights.flatness > 0) {
    value.flatness = SmoothnessForward<float>(*topology_, faces_, positions, normals_);
    AddSmoothnessGradient<float>(*topology_, faces_, positions, normals_,
                                 static_cast<float>(weights.flatness), &scratch_, d_positions);
  }
  if (weights.edge_length > 0) {
    EdgeSums sums;
    value.edge_length = EdgeLengthForward<float>(*topology_, positions, &sums);
    AddEdgeLengthGradient<float>(*topology_, positions, sums,
                                 static_cast<float>(weights.edge_length), d_positions);
  }
  return value;
}

}  // namespace tilegrad::train
