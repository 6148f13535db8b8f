// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "single_image"`. What each does: config.cc, one line a key.
#pragma once

#include <optional>
#include <string>

#include "rivals/renderer.h"
#include "tilegrad/status.h"
#include "train/data/stream/stream_config.h"
#include "train/models/mesh_network.h"
#include "train/run/config_fields.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

// The renderer that trains: ours, or one that section 5.1 compares with. Network, data, steps and
// the other losses stay the same, as in Table 1 of the paper.

struct RivalConfig {
  // SoftRas's own training settings except its near plane of 1: its cameras are 2.7 away from
  // objects, so nothing is nearer, and a nearer face would get no gradient.
  rivals::SoftRasOptions softras = {.near_plane = 0.1};
  std::string softras_distance = "euclidean", softras_alpha = "product";
  double softras_late_sigma = 1;  // factor on sigma after 60 % of the run
  bool softras_color = false;     // colours of vertices, mixed by softras_colors
  rivals::SoftRasColors softras_colors = {};
  rivals::N3mrOptions n3mr = {};
  std::string n3mr_reduction = "mean";
  bool n3mr_color = false;  // each face in the mean colour of its corners
};

ConfigFields FieldsOf(RivalConfig* config);

// The options of the rival `rule`; nullopt for "dibr". Errors: an unknown word.
Result<std::optional<rivals::Options>> RivalOptions(const std::string& rule,
                                                    const RivalConfig& config);
// At `share` of the run, in [0, 1].
double SoftRasSigmaAt(const RivalConfig& config, double share);

struct SingleImageConfig {
  NetworkConfig network;
  LossConfig loss;
  RenderConfig render;
  StreamConfig stream;
  RivalConfig rivals;
  OptimizerConfig optimizer;
  std::int64_t batch = 64;  // objects a step
  std::int64_t views = 2;   // per object: the input's own, the others random (section 5.1: 2)
  double mirrored = 0;      // share of samples mirrored at x = 0, light included
  Schedule schedule;        // of the run; no keys of the task
};

ConfigFields FieldsOf(SingleImageConfig* config);
// InvalidArgument names conflicting keys and unknown words.
Status CheckConfig(const SingleImageConfig& config);

}  // namespace tilegrad::train
