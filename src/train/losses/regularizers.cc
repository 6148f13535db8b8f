// SPDX-License-Identifier: Apache-2.0
#include "train/losses/regularizers.h"

#include "train/losses/area_edge_length.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"

namespace tilegrad::train {

ConfigFields FieldsOf(RegularizerWeights* w, const std::string& table) {
  return {
      {table + "smoothness", &w->smoothness, 0, kNoLimit,
       "weight of the normal difference of neighbouring faces"},
      {table + "laplacian", &w->laplacian, 0, kNoLimit,
       "weight of the Laplacian of the displacement"},
      {table + "edge_length", &w->edge_length, 0, kNoLimit, "weight of unequal edges"},
      {table + "area", &w->area, 0, kNoLimit, "weight of the surface area"},
  };
}

void AddRegularizers(const RegularizerWeights& w, const DeformedMeshes& m, LossSum* sum) {
  const auto add = [&](const char* name, const char* label, double weight, const auto& loss) {
    if (weight > 0) sum->Add(name, label, weight, loss());
  };
  add("smoothness", "Smoothness (normals of neighbouring faces)", w.smoothness,
      [&] { return SmoothnessLoss(m.positions, m.faces, m.topology); });
  add("laplacian", "Laplacian of the movement", w.laplacian,
      [&] { return LaplacianLoss(m.movement, m.topology); });
  add("edge_length", "Unequal edges", w.edge_length,
      [&] { return EdgeLengthLoss(m.positions, m.topology); });
  add("area", "Surface area", w.area, [&] { return AreaLoss(m.positions, m.faces) / m.unit_area; });
}

}  // namespace tilegrad::train
