// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "single_image"`. What each does: config.cc, one line a key.
#pragma once

#include "train/data/stream/stream_config.h"
#include "train/models/mesh_network.h"
#include "train/run/schedule.h"
#include "train/tasks/single_image/rivals.h"

namespace tilegrad::train {

// Weights of equation 14.
struct LossConfig {
  double iou = 1.0;
  double color = 1.0;
  double smoothness = 0.001;
  double laplacian = 0.01;
};

struct RenderConfig {
  // "dibr", "softras" or "n3mr". The rivals draw alpha alone, and there is no colour loss, unless
  // RivalConfig says otherwise; the next three numbers mean nothing to them. Pictures and scores
  // are always drawn by "dibr".
  std::string rule = "dibr";
  double sharpness = 7000;        // 1 / delta of equation 5, per squared NDC unit
  double sharpness_start = 7000;  // at step 0; moves to `sharpness` geometrically over half of the
                                  // run: a wide band first
  double max_alpha_error = 1e-5;
};

struct OptimizerConfig {
  double learning_rate = 1e-4;
  // The rate falls to this share by a half cosine over the run; 1: constant.
  double final_factor = 1.0;
  std::int64_t warmup = 0;  // steps over which the rate rises linearly from 0
  double beta1 = 0.9;
  double beta2 = 0.999;
  double average = 0;  // decay of a moving average of the weights, which is what predicts; 0: none
};

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
