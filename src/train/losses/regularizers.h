// SPDX-License-Identifier: Apache-2.0
// The regularisers of meshes, for trainings and fits: here each has its weight, its key and its
// term.
#pragma once

#include <span>
#include <string>

#include "scene/topology.h"
#include "train/losses/loss_sum.h"
#include "train/run/config_fields.h"

namespace tilegrad::train {

struct RegularizerWeights {  // >= 0
  double smoothness = 0, laplacian = 0, edge_length = 0, area = 0;
};
// Keys begin with `table`.
ConfigFields FieldsOf(RegularizerWeights* weights, const std::string& table);

// Meshes that share faces, at `positions` after a `movement`: [B, V, 3] both.
struct DeformedMeshes {
  std::span<const Face> faces;
  const Topology& topology;
  const nn::Var& positions;
  const nn::Var& movement;
  double unit_area = 1;  // that areas count in, squared world units
};

// Terms with the weight 0 are left out.
void AddRegularizers(const RegularizerWeights& weights, const DeformedMeshes& meshes, LossSum* sum);

}  // namespace tilegrad::train
