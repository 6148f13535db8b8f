// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "single_image"`. What each does: config.cc, one line a key.
#pragma once

#include "train/data/stream/stream_config.h"
#include "train/models/mesh_network.h"
#include "train/tasks/common_config.h"
#include "train/tasks/single_image/rivals.h"

namespace tilegrad::train {

struct SingleImageConfig {
  NetworkConfig network;
  LossConfig loss;
  RenderConfig render;
  StreamConfig stream;
  RivalConfig rivals;
  OptimizerConfig optimizer;
  std::int64_t batch = 64;  // objects a step
  std::int64_t views = 2;   // per object: the input's own, the others random (section 5.1: 2)
  double mirrored = 0;      // share of the samples that are shown mirrored at x = 0, light included
  Schedule schedule;        // of the run; no keys of the task
};

ConfigFields FieldsOf(SingleImageConfig* config);
// InvalidArgument names keys that do not go together, and words that are not known.
Status CheckConfig(const SingleImageConfig& config);

}  // namespace tilegrad::train
