// SPDX-License-Identifier: Apache-2.0
// Whose renderer trains: ours, or one of those that section 5.1 compares with. Network, data, steps
// and the other losses stay the same, which is Table 1 of the paper.
#pragma once

#include <optional>
#include <string>

#include "rivals/renderer.h"
#include "tilegrad/status.h"
#include "train/run/config_fields.h"

namespace tilegrad::train {

struct RivalConfig {
  // SoftRas's own training, but for its near plane of 1: its cameras are 2.7 away from objects, so
  // nothing is nearer, and a face that is has no gradient.
  rivals::SoftRasOptions softras = {.near_plane = 0.1};
  std::string softras_distance = "euclidean", softras_alpha = "product";
  double softras_late_sigma = 1;  // share of sigma after 60 % of the run
  bool softras_color = false;     // colours of vertices, mixed by softras_colors
  rivals::SoftRasColors softras_colors = {};
  rivals::N3mrOptions n3mr = {};
  std::string n3mr_reduction = "mean";
  bool n3mr_color = false;  // each face in the mean colour of its corners
};

ConfigFields FieldsOf(RivalConfig* config);

// What `rule` draws with; nothing for "dibr". Errors: a word that is none of those known.
Result<std::optional<rivals::Options>> RivalOptions(const std::string& rule,
                                                    const RivalConfig& config);
// Of a step, `share` of the run.
double SoftRasSigmaAt(const RivalConfig& config, double share);

}  // namespace tilegrad::train
