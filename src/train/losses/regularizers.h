// SPDX-License-Identifier: Apache-2.0
// The mesh regularisers of training and fits: the weight, key, label and term of each.
#pragma once

#include <span>
#include <string>

#include "scene/topology.h"
#include "train/losses/loss_sum.h"
#include "train/run/config_fields.h"
#include "train/run/run_files.h"

namespace tilegrad::train {

struct RegularizerWeights {  // >= 0
  double smoothness = 0, laplacian = 0, edge_length = 0, area = 0;
};
// Keys begin with `table`.
ConfigFields FieldsOf(RegularizerWeights* weights, const std::string& table);

// Of their terms in the log.
TermLabels RegularizerLabels();

// Meshes that share faces, at `positions` after a `movement`: [B, V, 3] both.
struct DeformedMeshes {
  std::span<const Face> faces;
  const Topology& topology;
  const nn::Var& positions;
  const nn::Var& movement;
  double unit_area = 1;  // unit of areas, squared world units
};

// Skips terms with weight 0.
void AddRegularizers(const RegularizerWeights& weights, const DeformedMeshes& meshes, LossSum* sum);

}  // namespace tilegrad::train
