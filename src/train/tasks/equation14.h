// SPDX-License-Identifier: Apache-2.0
// The terms of equation 14 that tasks share.
#pragma once

#include <span>

#include "scene/topology.h"
#include "train/losses/loss_sum.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

// alpha and truth: [N, size, size].
void AddIou(double weight, const nn::Var& alpha, const nn::Tensor& truth, LossSum* sum);
// `loss`: of colours, however they are compared.
void AddColor(double weight, const nn::Var& loss, LossSum* sum);

// Meshes that share their faces.
struct MovedMeshes {
  const nn::Var& positions;  // [B, V, 3]
  const nn::Var& movement;   // [B, V, 3] that led there
  std::span<const Face> faces;
  const Topology& topology;
};
void AddRegularizers(const LossConfig& weights, const MovedMeshes& meshes, LossSum* sum);

}  // namespace tilegrad::train
