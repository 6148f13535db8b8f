// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/common_config.h"

#include <algorithm>
#include <cmath>

#include "nn/schedule.h"

namespace tilegrad::train {

ConfigFields FieldsOf(LossConfig* c) {
  return {
      {"loss.iou", &c->iou, 0, kNoLimit, "weight of equation 12"},
      {"loss.color", &c->color, 0, kNoLimit, "weight of equation 13"},
      {"loss.smoothness", &c->smoothness, 0, kNoLimit,
       "weight of the normal difference of neighbouring faces"},
      {"loss.laplacian", &c->laplacian, 0, kNoLimit, "weight of the Laplacian of the movement"},
  };
}

ConfigFields FieldsOf(RenderConfig* c) {
  return {
      {"render.rule", &c->rule, 0, 0, "whose renderer trains: \"dibr\", \"softras\" or \"n3mr\""},
      {"render.sharpness", &c->sharpness, 1e-3, 1e9, "1/delta of equation 5, per squared NDC unit"},
      {"render.sharpness_start", &c->sharpness_start, 1e-3, 1e9,
       "at step 0; reaches sharpness geometrically at half of the run"},
      {"render.max_alpha_error", &c->max_alpha_error, 0, 1, "bound on the error of alpha"},
  };
}

ConfigFields FieldsOf(OptimizerConfig* c) {
  return {
      {"optimizer.learning_rate", &c->learning_rate, 0, 1, "of Adam"},
      {"optimizer.final_factor", &c->final_factor, 0, 1,
       "share of the rate at the end (half cosine); 1: constant"},
      {"optimizer.warmup", &c->warmup, 0, kNoLimit, "steps of linear rise"},
      {"optimizer.beta1", &c->beta1, 0, 0.999999, "of Adam"},
      {"optimizer.beta2", &c->beta2, 0, 0.99999999, "of Adam"},
      {"optimizer.average", &c->average, 0, 0.999999,
       "decay of a moving average of the weights, which predicts; 0: none"},
  };
}

double LearningRateAt(const OptimizerConfig& o, std::int64_t steps, std::int64_t step) {
  const nn::CosineSchedule cosine{steps, o.final_factor};
  return nn::WarmedUp(nn::CosineRate(o.learning_rate, cosine, step), o.warmup, step);
}

double SharpnessAt(const RenderConfig& render, std::int64_t steps, std::int64_t step) {
  const double share = std::min(1.0, 2.0 * static_cast<double>(step) / static_cast<double>(steps));
  return render.sharpness_start * std::pow(render.sharpness / render.sharpness_start, share);
}

}  // namespace tilegrad::train
