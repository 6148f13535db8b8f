// SPDX-License-Identifier: Apache-2.0
// The configuration of a training run, read from and written to TOML. docs of each key: config.cc,
// one line a key.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// The network of section 5.1; the defaults are the paper's, 34,115,916 parameters at 64
// x 64 with the 642-vertex template.
struct NetworkConfig {
  std::int64_t channels = 64;   // of the first convolution; the next two have 2x and 4x
  std::int64_t code = 1024;     // width of the encoder's three fully connected layers
  std::int64_t hidden1 = 1024;  // widths of each decoder
  std::int64_t hidden2 = 2048;
  std::int64_t template_level = 3;  // subdivisions of the icosahedron: 3 gives 642 vertices
  double template_radius = 0.175;   // world units
  double output_deviation = 0.001;  // the decoders' last weights start as N(0, this^2): the first
                                    // prediction is nearly the template
  double fc_deviation = 0.001;      // fully connected weights start as N(0, this^2); 0: uniform by
                                    // fan-in, as convolutions
  double color_bias = 0.0;          // what vertex colours start at
};

// Weights of equation 14.
struct LossConfig {
  double iou = 1.0;
  double color = 1.0;
  double smoothness = 0.001;
  double laplacian = 0.01;
};

struct RenderConfig {
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
};

struct ScheduleConfig {
  std::int64_t steps = 50000;
  std::int64_t batch = 64;  // objects a step
  std::int64_t views = 2;   // per object: the input's own, the others random (section 5.1: 2)
  std::int64_t seed = 1;
  std::int64_t log_every = 20;  // steps
  std::int64_t sample_every = 1000;
  std::int64_t checkpoint_every = 500;
  std::int64_t keep_checkpoints = 3;  // the newest ones
};

struct TrainConfig {
  std::string name = "paper";  // for people
  NetworkConfig network;
  LossConfig loss;
  RenderConfig render;
  OptimizerConfig optimizer;
  ScheduleConfig schedule;
};

// An unknown key, a wrong type or a value out of range is an error that names file, line and key,
// and the closest known key.
Result<TrainConfig> ReadConfig(const Path& path);
Result<TrainConfig> ParseConfig(std::string_view text,
                                const std::string& name);  // `name` stands in messages
// "schedule.steps=100" and the like, applied in order.
Status ApplyOverrides(const std::vector<std::string>& assignments, TrainConfig* config);
// Complete, with a comment on each key; reading it back gives the same configuration.
std::string WriteConfig(const TrainConfig& config);

}  // namespace tilegrad::train
