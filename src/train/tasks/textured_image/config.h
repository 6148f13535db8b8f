// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "textured_image"`. What each does: config.cc and the parts' own tables,
// one line a key.
#pragma once

#include "train/data/stream/textured_stream.h"
#include "train/models/texture_network.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

struct TexturedImageConfig {
  TextureNetworkConfig network;
  LossConfig loss;
  RenderConfig render;  // its rule is ours
  LightConfig light;
  TexturedStreamConfig stream;
  OptimizerConfig optimizer;
  std::int64_t batch = 32;  // objects a step, each in two views under two lights
  Schedule schedule;        // of the run; no keys of the task
};

ConfigFields FieldsOf(TexturedImageConfig* config);
Status CheckConfig(const TexturedImageConfig& config);
LightHeadShape LightHeadOf(const LightConfig& config);

}  // namespace tilegrad::train
