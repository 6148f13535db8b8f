// SPDX-License-Identifier: Apache-2.0
// Steps of vertices that stay smooth: B. Nicolet, A. Jacobson, W. Jakob, Large Steps in Inverse
// Rendering of Geometry, 2021. Adam multiplies gradients and steps by (1 + lambda L)^-1, L the
// combinatorial Laplacian (degree - adjacency), so that a mesh moves in large before it moves in
// detail and does not tangle.
#pragma once

#include <memory>
#include <span>

#include "nn/optim.h"
#include "scene/topology.h"

namespace tilegrad::train {

class Diffusion : public nn::StepMap {
 public:
  // `topology` must outlive this. lambda >= 0; 0 changes nothing.
  Diffusion(const Topology& topology, double lambda);
  ~Diffusion() override;

  // x [V,3] <- (1 + lambda L)^-1 x. The first call factorises the matrix; later ones allocate
  // nothing. A pure function of x.
  void Apply(std::span<float> x) override;

 private:
  struct System;
  const Topology* topology_;
  double lambda_;
  std::unique_ptr<System> system_;
};

}  // namespace tilegrad::train
