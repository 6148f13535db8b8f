// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/config.h"

#include <algorithm>

#include "base/error.h"
#include "train/tasks/gan/real_pictures.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(GeneratorConfig* c) {
  return {
      {"network.noise", &c->noise, 1, 4096, "numbers of a latent code; all decide the texture"},
      {"network.shape_noise", &c->shape_noise, 1, 4096, "of them that decide the shape"},
      {"network.hidden", &c->hidden, 1, 65536, "width of the two layers before the vertices"},
      {"network.template_level", &c->template_level, 0, 6,
       "subdivisions of the icosahedron; 3: 642 vertices"},
      {"network.template_radius", &c->template_radius, 1e-3, 10, "world units"},
      {"network.smoothing", &c->smoothing, 0, 64,
       "rounds of diffusion over the template that offsets go through"},
      {"network.symmetric", &c->symmetric, 0, 1, "every shape is symmetric at x = 0"},
      {"network.output_deviation", &c->output_deviation, 0, 10,
       "the last weights of vertices start as N(0, this^2)"},
      {"network.texture_size", &c->texture_size, 16, 4096, "texels a side, a power of two"},
      {"network.texture_base", &c->texture_base, 1, 4096,
       "channels of maps at full size; they double with each halving"},
      {"network.texture_most", &c->texture_most, 1, 4096, "to at most this many"},
      {"network.symmetric_texture", &c->symmetric_texture, 0, 1,
       "every texture is symmetric at x = 0"},
  };
}

ConfigFields FieldsOf(GanCriticConfig* c) {
  return {
      {"critic.base", &c->base, 1, 4096, "a critic's channels at half size; they double"},
      {"critic.halvings", &c->halvings, 1, 8, "of a critic"},
      {"critic.updates", &c->updates, 1, 100, "of each critic in each step"},
      {"critic.penalty", &c->penalty, 0, kNoLimit, "weight of the gradient penalty"},
      {"critic.learning_rate", &c->learning_rate, 0, 1,
       "of the critics' Adam, which else goes as [optimizer] says"},
      {"critic.texture_weight", &c->texture_weight, 0, kNoLimit,
       "of the critic of texture maps beside that of pictures; 0: there is none"},
  };
}

// Cameras never change.
ConfigFields StreamFields(TexturedStreamConfig* c) {
  const std::vector<std::string> cameras = {
      "stream.elevation_low", "stream.elevation_high", "stream.around_low", "stream.around_high",
      "stream.fov_low",       "stream.fov_high",       "stream.roll",       "stream.jitter"};
  ConfigFields fields = FieldsOf(c);
  std::erase_if(fields, [&](const ConfigField& field) {
    return std::ranges::find(cameras, field.key) != cameras.end();
  });
  return fields;
}

}  // namespace

Status CheckConfig(const GanConfig& config) {
  TILEGRAD_TRY(CheckGenerator(config.network));
  if (config.score_count < 8)
    return InvalidArgument("score.count is {}, but must be at least 8", config.score_count);
  const bool textures = config.schedule.steps > config.shape_steps;
  if (textures && config.textures.run.empty()) {
    return InvalidArgument(
        "stages.shape ends at step {} of {}: textures then need textures.run, the folder of a run "
        "of configs/texture_quick.toml on the same dataset",
        config.shape_steps, config.schedule.steps);
  }
  if (config.shape_steps > 0 || !config.start.empty()) return {};
  return InvalidArgument(
      "stages.shape = 0 leaves shapes as they start: start.run must name a run that has some");
}

ConfigFields FieldsOf(GanConfig* c) {
  ConfigFields own = {
      {"loss.smoothness", &c->loss.smoothness, 0, kNoLimit,
       "weight of the normal difference of neighbouring faces"},
      {"loss.laplacian", &c->loss.laplacian, 0, kNoLimit,
       "weight of the Laplacian of the movement"},
      {"critic.views", &c->views, 1, kMostViews,
       "that critics see side by side: front, side, back, above, and two between; 4 in the paper"},
      {"stages.shape", &c->shape_steps, 0, kNoLimit,
       "steps that shapes learn in; then they are frozen, and textures learn"},
      {"start.run", &c->start, 0, 0,
       "folder of a run whose shapes this one starts with; \"\": a sphere"},
      {"textures.run", &c->textures.run, 0, 0,
       "folder of the run of task.kind = \"textured_image\" that extracts textures"},
      {"textures.count", &c->textures.count, 1, 1000000, "pictures that it extracts them from"},
      {"render.sharpness", &c->render.sharpness, 1e-3, 1e9,
       "1/delta of equation 5, per squared NDC unit"},
      {"render.max_alpha_error", &c->render.max_alpha_error, 0, 1, "bound on the error of alpha"},
      {"score.every", &c->score_every, 1, kNoLimit,
       "steps between scores of the generator, of which the best is kept"},
      {"score.count", &c->score_count, 8, 4096, "objects that a score is taken of"},
      {"schedule.batch", &c->batch, 2, 65536, "objects a step"}};
  ConfigFields fields;
  for (const ConfigFields& more : {FieldsOf(&c->network), FieldsOf(&c->critic), own,
                                   FieldsOf(&c->optimizer), StreamFields(&c->stream)})
    fields.insert(fields.end(), more.begin(), more.end());
  return fields;
}

}  // namespace tilegrad::train
