// SPDX-License-Identifier: Apache-2.0
// The mesh regularisers of a fit, on one mesh: Laplacian of the movement since the start, flatness
// (losses/smoothness.h), edge length and area.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "scene/topology.h"
#include "train/losses/edge_length.h"
#include "train/losses/smoothness.h"

namespace tilegrad::train {

// Weights, >= 0; or the values of the losses.
struct RegularizerTerms {
  double laplacian = 0, flatness = 0, edge_length = 0;
  double area = 0;  // of the surface, over what it was at the start
};

// Keeps its scratch: nothing is allocated after the first call.
class Regularizer {
 public:
  Regularizer(std::span<const std::int32_t> faces, std::span<const float> start);

  const Topology& topology() const { return *topology_; }
  std::span<const float> start() const { return start_; }
  // Values of the terms that have a weight; d_positions += weight times their gradients.
  RegularizerTerms Add(const RegularizerTerms& weights, std::span<const float> positions,
                       std::span<float> d_positions);

 private:
  double AddLaplacian(float weight, std::span<const float> positions, std::span<float> d_positions);

  double AddArea(double weight, std::span<const float> positions, std::span<float> d_positions);

  std::vector<Face> faces_;
  double start_area_ = 0;
  std::vector<float> start_, movement_, residual_, d_movement_;
  std::unique_ptr<Topology> topology_;  // stays where it is when this is moved
  std::vector<FaceNormal<float>> normals_;
  std::vector<Vec3<float>> scratch_;
};

}  // namespace tilegrad::train
