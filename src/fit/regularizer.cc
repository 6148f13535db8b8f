// SPDX-License-Identifier: Apache-2.0
#include "fit/regularizer.h"

#include <glm/geometric.hpp>

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
  std::vector<float> ignored(start.size());
  start_area_ = AddArea(0, start, ignored);
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

// A face of area |n| / 2 with n = (b - a) x (c - a): dA/da = n / |n| x (c - b) / 2, and so on
// around.
double Regularizer::AddArea(double weight, std::span<const float> positions,
                            std::span<float> d_positions) {
  double sum = 0;
  const double scale = start_area_ > 0 ? weight / start_area_ : 0;
  for (const Face& f : faces_) {
    glm::dvec3 p[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const float* at = &positions[3 * static_cast<std::size_t>(f[k])];
      p[k] = {at[0], at[1], at[2]};
    }
    const glm::dvec3 n = glm::cross(p[1] - p[0], p[2] - p[0]);
    const double length = glm::length(n);
    if (!(length > 0)) continue;
    sum += 0.5 * length;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 d = 0.5 * scale / length * glm::cross(n, p[(k + 2) % 3] - p[(k + 1) % 3]);
      float* to = &d_positions[3 * static_cast<std::size_t>(f[k])];
      for (int c = 0; c < 3; ++c) to[c] += static_cast<float>(d[c]);
    }
  }
  return start_area_ > 0 ? sum / start_area_ : sum;
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
  if (weights.area > 0) value.area = AddArea(weights.area, positions, d_positions);
  return value;
}

}  // namespace tilegrad::train
