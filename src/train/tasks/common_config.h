// SPDX-License-Identifier: Apache-2.0
// Keys that tasks with our renderer share: [loss], [render], [optimizer].
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>

#include "train/losses/loss_sum.h"
#include "train/losses/regularizers.h"
#include "train/models/picture_lookup.h"
#include "train/models/sphere_model.h"
#include "train/run/config_fields.h"
#include "train/run/run.h"

namespace tilegrad::train {

// Weights of equation 14.
struct LossConfig : RegularizerWeights {
  LossConfig() : RegularizerWeights{.smoothness = 0.001, .laplacian = 0.01} {}
  double iou = 1.0;
  double color = 1.0;
};

struct RenderConfig {
  // "dibr", "softras" or "n3mr". The rivals draw only alpha, without a colour loss unless
  // RivalConfig enables one, and ignore the next three numbers. Pictures and scores always use
  // "dibr".
  std::string rule = "dibr";
  double sharpness = 7000;        // 1 / delta of equation 5, per squared NDC unit
  double sharpness_start = 7000;  // at step 0; changes geometrically to `sharpness` over the first
                                  // half of the run: a wide band first
  double max_alpha_error = 1e-5;
};

struct OptimizerConfig {
  double learning_rate = 1e-4;
  // The rate falls to this share by a half cosine over the run; 1: constant.
  double final_factor = 1.0;
  std::int64_t warmup = 0;  // steps over which the rate rises linearly from 0
  // Steps at the end with a rate of 0, at most a hundredth of the run: batch norm's running
  // statistics, which prediction uses, lag behind weights that move.
  std::int64_t settle = 50;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double weight_decay = 0;  // AdamW's; a key only of tasks that use it
  double average = 0;  // decay of the moving average of the weights, which then predicts; 0: none
};

// Concatenated.
ConfigFields Joined(std::initializer_list<ConfigFields> parts);
// Drops the keys of a shared table that a task does not use.
ConfigFields Without(ConfigFields fields, std::initializer_list<std::string_view> keys);

ConfigFields FieldsOf(SphereConfig* config);  // of [network]; without n3mr_vertices

ConfigFields FieldsOf(PictureCodeConfig* config);  // of [network]

// Standard deviation of the vertex head's initial weights, N(0, value^2).
ConfigField OutputDeviation(double* value);

ConfigFields FieldsOf(LossConfig* config);
ConfigFields FieldsOf(RenderConfig* config);
ConfigFields FieldsOf(OptimizerConfig* config);

// The learning rate and 1/delta at a step of a run of `steps`.
double LearningRateAt(const OptimizerConfig& config, std::int64_t steps, std::int64_t step);
double SharpnessAt(const RenderConfig& config, std::int64_t steps, std::int64_t step);
// For square images with 1/delta = `sharpness`.
RenderOptions OptionsOf(const RenderConfig& config, double sharpness, int size);

// The terms of equation 14 that tasks share.

// alpha and truth: [N, size, size].
void AddIou(double weight, const nn::Var& alpha, const nn::Tensor& truth, LossSum* sum);
// `loss`: any colour loss.
void AddColor(double weight, const nn::Var& loss, LossSum* sum);

}  // namespace tilegrad::train
