// SPDX-License-Identifier: Apache-2.0
// Steps of vertices that stay smooth: B. Nicolet, A. Jacobson, W. Jakob, Large Steps in Inverse
// Rendering of Geometry, 2021. Gradients and steps are multiplied by (1 + lambda L)^-1, L the
// combinatorial Laplacian (degree - adjacency), so that a mesh moves in large before it moves in
// detail and does not tangle.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/topology.h"

namespace tilegrad::train {

class Diffusion {
 public:
  // `topology` must outlive this. lambda >= 0; 0 changes nothing.
  Diffusion(const Topology& topology, double lambda);

  // x [V,3] <- (1 + lambda L)^-1 x by conjugate gradients, to a relative residual of 1e-5 or
  // kMostIterations. Allocates nothing. A pure function of x.
  void Apply(std::span<float> x);

  static constexpr int kMostIterations = 300;

 private:
  void Multiply(const std::vector<float>& x, std::vector<float>* y) const;

  const Topology* topology_;
  float lambda_;
  std::vector<float> solution_, residual_, direction_, image_;
};

// Adam with one second moment for all numbers, as that paper proposes: a step keeps the direction
// of the gradient's average. values -= rate m^ / sqrt(max v^), where `smooth` is
// applied to the gradient before and to the step after.
struct UniformAdam {
  double rate = 0, beta1 = 0.9, beta2 = 0.999;
  std::int64_t step = 1;  // of this one: 1, 2, ...
};
void UniformAdamStep(const UniformAdam& adam, Diffusion* smooth, std::span<float> gradient,
                     std::span<float> m, std::span<float> v, std::span<float> values);

}  // namespace tilegrad::train
