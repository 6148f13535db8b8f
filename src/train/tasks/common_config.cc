// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/common_config.h"

#include <algorithm>

#include "nn/optim.h"
#include "train/losses/iou.h"

namespace tilegrad::train {

ConfigFields Joined(std::initializer_list<ConfigFields> parts) {
  ConfigFields all;
  for (const ConfigFields& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

ConfigFields Without(ConfigFields fields, std::initializer_list<std::string_view> keys) {
  std::erase_if(fields, [&](const ConfigField& field) {
    return std::ranges::find(keys, field.key) != keys.end();
  });
  return fields;
}

ConfigFields FieldsOf(SphereConfig* c) {
  return {
      {"network.template_level", &c->level, 0, 6,
       "subdivisions of the icosahedron; 3: 642 vertices"},
      {"network.template_radius", &c->radius, 1e-3, 10, "world units"},
      {"network.smoothing", &c->smoothing, 0, 64,
       "diffusion rounds that smooth the offsets over the template"},
      {"network.symmetric", &c->symmetric, 0, 1, "every shape is symmetric at x = 0"},
  };
}

ConfigFields FieldsOf(PictureCodeConfig* c) {
  return {
      {"network.base", &c->base, 1, 4096, "U-Net: channels of the first level; they double"},
      {"network.most", &c->most, 1, 4096, "up to this many channels"},
      {"network.levels", &c->levels, 1, 10, "halvings"},
      {"network.enlarge", &c->enlarge, 0, 4, "the texture is 2^this times as large as the image"},
      {"network.skips", &c->skips, 0, 1, "the U-Net's skip connections"},
      {"network.latent", &c->latent, 1, 65536, "width of the code that all heads start from"},
  };
}

ConfigField OutputDeviation(double* value) {
  return {"network.output_deviation", value, 0, 10,
          "the last weights of vertices start as N(0, this^2)"};
}

ConfigFields FieldsOf(LossConfig* c) {
  // The paper's; fits have the others, too.
  return Joined({{{"loss.iou", &c->iou, 0, kNoLimit, "weight of equation 12"},
                  {"loss.color", &c->color, 0, kNoLimit, "weight of equation 13"}},
                 Without(FieldsOf(c, "loss."), {"loss.edge_length", "loss.area"})});
}

ConfigFields FieldsOf(RenderConfig* c) {
  return {
      {"render.rule", &c->rule, 0, 0, "training renderer: \"dibr\", \"softras\" or \"n3mr\""},
      {"render.sharpness", &c->sharpness, 1e-3, 1e9, "1/delta of equation 5, per squared NDC unit"},
      {"render.sharpness_start", &c->sharpness_start, 1e-3, 1e9,
       "sharpness at step 0; grows geometrically to render.sharpness at half of the run"},
      {"render.max_alpha_error", &c->max_alpha_error, 0, 1, "bound on the error of alpha"},
  };
}

ConfigFields FieldsOf(OptimizerConfig* c) {
  return {
      {"optimizer.learning_rate", &c->learning_rate, 0, 1, "of Adam"},
      {"optimizer.final_factor", &c->final_factor, 0, 1,
       "final fraction of the learning rate (half cosine); 1: constant"},
      {"optimizer.warmup", &c->warmup, 0, kNoLimit, "steps of linear warm-up"},
      {"optimizer.settle", &c->settle, 0, kNoLimit,
       "last steps, of rate 0, in which batch norm's running statistics catch up with the weights; "
       "at most 1 % of the run"},
      {"optimizer.beta1", &c->beta1, 0, 0.999999, "of Adam"},
      {"optimizer.beta2", &c->beta2, 0, 0.99999999, "of Adam"},
      {"optimizer.average", &c->average, 0, 0.999999,
       "decay of the moving average of the weights that is used for prediction; 0: none"},
  };
}

double LearningRateAt(const OptimizerConfig& o, std::int64_t steps, std::int64_t step) {
  if (step >= steps - std::min(o.settle, steps / 100)) return 0;
  const nn::CosineSchedule cosine{steps, o.final_factor};
  return nn::WarmedUp(nn::CosineRate(o.learning_rate, cosine, step), o.warmup, step);
}

RenderOptions OptionsOf(const RenderConfig& config, double sharpness, int size) {
  RenderOptions options;
  options.width = options.height = size;
  options.delta = 1 / sharpness;
  options.max_alpha_error = config.max_alpha_error;
  return options;
}

double SharpnessAt(const RenderConfig& render, std::int64_t steps, std::int64_t step) {
  const double share = 2.0 * static_cast<double>(step) / static_cast<double>(steps);
  return nn::Geometric(render.sharpness_start, render.sharpness, share);
}

void AddIou(double weight, const nn::Var& alpha, const nn::Tensor& truth, LossSum* sum) {
  sum->Add("iou", "IoU loss (1 − soft IoU of silhouettes)", weight, IouLoss(alpha, truth));
}

void AddColor(double weight, const nn::Var& loss, LossSum* sum) {
  sum->Add("color", "Colour loss (mean L1)", weight, loss);
}

}  // namespace tilegrad::train
