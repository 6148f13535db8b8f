// SPDX-License-Identifier: Apache-2.0
// Steps of vertices that stay smooth: B. Nicolet, A. Jacobson, W. Jakob, Large Steps in Inverse
// Rendering of Geometry, 2021. Gradients and steps are multiplied by (1 + lambda L)^-1, L the
// combinatorial Laplacian (degree - adjacency), so that a mesh moves in large before it moves in
// detail and does not tangle.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "scene/topology.h"

namespace tilegrad::train {

class Diffusion {
 public:
  // `topology` must outlive this. lambda >= 0; 0 changes nothing.
  Diffusion(const Topology& topology, double lambda);
  Diffusion(Diffusion&&) noexcept;
  Diffusion& operator=(Diffusion&&) noexcept;
  ~Diffusion();

  // x [V,3] <- (1 + lambda L)^-1 x. The first call factorises the matrix; later ones allocate
  // nothing. A pure function of x.
  void Apply(std::span<float> x);

 private:
  struct System;
  const Topology* topology_;
  double lambda_;
  std::unique_ptr<System> system_;
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
