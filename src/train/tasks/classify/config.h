// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "classify"`. What each does: config.cc, one line a key.
#pragma once

#include "train/models/classifier.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

struct ClassifyConfig {
  ClassifierConfig network;
  OptimizerConfig optimizer = {
      .learning_rate = 2e-3, .final_factor = 0.01, .warmup = 20, .weight_decay = 1e-2};
  std::int64_t batch = 64;
  double mirrored = 0.5;   // share of pictures mirrored
  std::int64_t shift = 4;  // most pixels of a random shift, each way; black fills in
  Schedule schedule;       // of the run; no keys of the task
};

ConfigFields FieldsOf(ClassifyConfig* config);

}  // namespace tilegrad::train
