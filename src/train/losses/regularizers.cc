// SPDX-License-Identifier: Apache-2.0
#include "train/losses/regularizers.h"

#include "train/losses/area_edge_length.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"

namespace tilegrad::train {
namespace {

struct Regularizer {
  const char *name, *label, *help;
  double RegularizerWeights::*weight;
  nn::Var (*loss)(const DeformedMeshes&);
};

// In the order of keys, terms and sums.
constexpr Regularizer kRegularizers[] = {
    {"smoothness", "Smoothness (normals of neighbouring faces)",
     "weight of the normal difference of neighbouring faces", &RegularizerWeights::smoothness,
     [](const DeformedMeshes& m) { return SmoothnessLoss(m.positions, m.faces, m.topology); }},
    {"laplacian", "Laplacian of the movement", "weight of the Laplacian of the displacement",
     &RegularizerWeights::laplacian,
     [](const DeformedMeshes& m) { return LaplacianLoss(m.movement, m.topology); }},
    {"edge_length", "Unequal edges", "weight of unequal edges", &RegularizerWeights::edge_length,
     [](const DeformedMeshes& m) { return EdgeLengthLoss(m.positions, m.topology); }},
    {"area", "Surface area", "weight of the surface area", &RegularizerWeights::area,
     [](const DeformedMeshes& m) { return AreaLoss(m.positions, m.faces) / m.unit_area; }},
};

}  // namespace

ConfigFields FieldsOf(RegularizerWeights* weights, const std::string& table) {
  ConfigFields out;
  for (const Regularizer& r : kRegularizers)
    out.push_back({table + r.name, &(weights->*r.weight), 0, kNoLimit, r.help});
  return out;
}

TermLabels RegularizerLabels() {
  TermLabels out;
  for (const Regularizer& r : kRegularizers) out.emplace(r.name, r.label);
  return out;
}

void AddRegularizers(const RegularizerWeights& weights, const DeformedMeshes& meshes,
                     LossSum* sum) {
  for (const Regularizer& r : kRegularizers) {
    const double weight = weights.*r.weight;
    if (weight > 0) sum->Add(r.name, r.label, weight, r.loss(meshes));
  }
}

}  // namespace tilegrad::train
