// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/config.h"

#include "base/error.h"
#include "train/tasks/gan/real_samples.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(GeneratorConfig* c) {
  return Joined(
      {{{"network.noise", &c->noise, 1, 4096,
         "dimensions of a latent code; all of them drive the texture"},
        {"network.shape_noise", &c->shape_noise, 1, 4096,
         "dimensions of the code that drive the shape"},
        {"network.hidden", &c->hidden, 1, 65536, "width of the two layers before the vertices"}},
       FieldsOf(&c->sphere),
       {OutputDeviation(&c->output_deviation),
        {"network.texture_size", &c->texture_size, 16, 4096, "texels a side, a power of two"},
        {"network.texture_base", &c->texture_base, 1, 4096,
         "channels of maps at full size; they double with each halving"},
        {"network.texture_most", &c->texture_most, 1, 4096, "up to this many channels"},
        {"network.symmetric_texture", &c->symmetric_texture, 0, 1,
         "every texture is symmetric at x = 0"}}});
}

ConfigFields FieldsOf(GanCriticConfig* c) {
  return {
      {"critic.base", &c->base, 1, 4096, "a critic's channels at half size; they double"},
      {"critic.halvings", &c->halvings, 1, 8, "halvings of a critic"},
      {"critic.updates", &c->updates, 1, 100, "updates of each critic per step"},
      {"critic.penalty", &c->penalty, 0, kNoLimit, "weight of the gradient penalty"},
      {"critic.learning_rate", &c->learning_rate, 0, 1,
       "learning rate of the critics' Adam; its other settings are those of [optimizer]"},
      {"critic.texture_weight", &c->texture_weight, 0, kNoLimit,
       "weight of the critic of texture maps relative to that of pictures; 0: no such critic"},
  };
}

// Cameras never change.
ConfigFields StreamFields(TexturedStreamConfig* c) {
  return Without(
      FieldsOf(c),
      {"stream.fixed_camera", "stream.elevation_low", "stream.elevation_high", "stream.around_low",
       "stream.around_high", "stream.fov_low", "stream.fov_high", "stream.roll", "stream.jitter"});
}

}  // namespace

Status CheckConfig(const GanConfig& config) {
  TILEGRAD_TRY(CheckGenerator(config.network));
  if (config.score_count < 8)
    return InvalidArgument("score.count is {}, but must be at least 8", config.score_count);
  const bool textures = config.schedule.steps > config.shape_steps;
  if (textures && config.textures.run.empty())
    return InvalidArgument(
        "stages.shape ends at step {} of {}: textures then need textures.run, the folder of a run "
        "of configs/texture_quick.toml on the same dataset",
        config.shape_steps, config.schedule.steps);
  if (config.shape_steps > 0 || !config.start.empty()) return {};
  return InvalidArgument(
      "stages.shape = 0 trains no shapes: start.run must name a run that has them");
}

ConfigFields FieldsOf(GanConfig* c) {
  return Joined(
      {FieldsOf(&c->network),
       FieldsOf(&c->critic),
       Without(FieldsOf(&c->loss), {"loss.iou", "loss.color"}),
       {{"critic.views", &c->views, 1, kMostViews,
         "number of views that critics see side by side: front, side, back, above, and two "
         "between; 4 in the paper"},
        {"stages.shape", &c->shape_steps, 0, kNoLimit,
         "steps that train shapes; then shapes are frozen and textures are trained"},
        {"start.run", &c->start, 0, 0,
         "folder of a run whose shapes initialise this one; \"\": a sphere"},
        {"textures.run", &c->textures.run, 0, 0,
         "folder of the run of task.kind = \"textured_image\" that extracts textures",
         Affects::kPlace},
        {"textures.count", &c->textures.count, 1, 1000000, "pictures to extract textures from"}},
       Without(FieldsOf(&c->render), {"render.rule", "render.sharpness_start"}),
       {{"score.every", &c->score_every, 1, kNoLimit,
         "steps between scores of the generator; the best generator is kept"},
        {"score.count", &c->score_count, 8, 4096, "objects per score"},
        {"schedule.batch", &c->batch, 2, 65536, "objects per step"}},
       FieldsOf(&c->optimizer),
       StreamFields(&c->stream)});
}

}  // namespace tilegrad::train
