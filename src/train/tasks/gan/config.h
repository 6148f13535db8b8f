// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "gan"`. What each does: config.cc and the parts' own tables, one line a
// key.
#pragma once

#include <algorithm>

#include "train/data/stream/textured_stream.h"
#include "train/models/shape_texture_generator.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

// For each critic; section 5.5 specifies only the loss (WGAN-GP).
struct GanCriticConfig {
  std::int64_t base = 24, halvings = 4;  // nn::CriticShape
  std::int64_t updates = 1;              // in each step
  double penalty = 10;                   // lambda_gp, at interpolates
  double learning_rate = 1e-3;
  double texture_weight = 0.25;  // of D_t relative to D_I; 0: no D_t
};

struct GanTextureSource {
  std::string run;            // of task.kind = "textured_image"
  std::int64_t count = 2000;  // pictures that it extracts textures from
};

struct GanConfig {
  GeneratorConfig network;
  GanCriticConfig critic;
  LossConfig loss;                  // only its regularisers; the paper's section 5.5 has none
  std::int64_t shape_steps = 3500;  // of the run; then shapes are frozen and textures trained
  std::string start;                // a run, or checkpoint, whose shapes this one starts with
  GanTextureSource textures;
  RenderConfig render;  // only `sharpness` and `max_alpha_error`
  OptimizerConfig optimizer;
  std::int64_t views = 4;  // kMostViews at most
  std::int64_t batch = 16;
  std::int64_t score_every = 250, score_count = 128;
  TexturedStreamConfig stream;  // without its camera keys
  Schedule schedule;            // of the run; no keys of the task

  // Steps of the schedules of the shape stage or the texture stage.
  std::int64_t StageSteps(bool shapes) const {
    return std::max<std::int64_t>(1, shapes ? shape_steps : schedule.steps - shape_steps);
  }
};

ConfigFields FieldsOf(GanConfig* config);
Status CheckConfig(const GanConfig& config);

}  // namespace tilegrad::train
