// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "textured_image"`. What each does: config.cc and the parts' own tables,
// one line a key.
#pragma once

#include "train/data/stream/textured_stream.h"
#include "train/models/texture_network.h"
#include "train/tasks/adversary.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

// How colours are compared, in addition to LossConfig::color.
struct ColorRule {
  bool masked = false;    // only where the truth's object is, by its cover of a pixel
  double from = 0;        // share of the run after which colours count: shapes first
  double soft = 0;        // ColorHuberLoss, up to `soft_until`; 0: L1
  double soft_until = 1;  // share of the run
  // Weight of the view that a texture was predicted from, relative to the other one. In that view a
  // texture with baked-in shading is no worse than one without.
  double own = 1;
  double light = 0;  // weight of the mean squared distance to the light that LightSearch finds
  double pose = 1;   // weight of the mean squared error of Pose, learned from the known cameras
};

struct TexturedImageConfig {
  TextureNetworkConfig network;
  LossConfig loss;
  ColorRule color;
  AdversaryConfig adversary;
  std::string start;    // a run, or checkpoint, whose network this one starts as; empty: as new
  RenderConfig render;  // its rule is "dibr" or "n3mr"
  LightConfig light;
  TexturedStreamConfig stream;
  OptimizerConfig optimizer;
  std::int64_t batch = 32;  // objects a step, each in two views under two lights
  Schedule schedule;        // of the run; no keys of the task
};

ConfigFields FieldsOf(TexturedImageConfig* config);
Status CheckConfig(const TexturedImageConfig& config);
// Whether N3MR's renderer trains, with texture cubes sampled from the network's maps.
bool IsN3mr(const TexturedImageConfig& config);
TextureNetworkConfig NetworkOf(const TexturedImageConfig& config);  // as the rule requires
LightHeadShape LightHeadOf(const LightConfig& config);

}  // namespace tilegrad::train
