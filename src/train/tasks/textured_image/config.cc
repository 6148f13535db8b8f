// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/config.h"

#include "base/error.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(TextureNetworkConfig* c) {
  return {
      {"network.base", &c->base, 1, 4096, "U-Net: channels of the first level; they double"},
      {"network.most", &c->most, 1, 4096, "to at most this many"},
      {"network.levels", &c->levels, 1, 10, "halvings"},
      {"network.enlarge", &c->enlarge, 0, 4, "the texture is 2^this times as large as the image"},
      {"network.skips", &c->skips, 0, 1, "the U-Net's skip connections"},
      {"network.wrap", &c->wrap, 0, 1,
       "left and right edge of the texture are neighbours in the decoder"},
      {"network.latent", &c->latent, 1, 65536, "width of the code that all heads start from"},
      {"network.hidden", &c->hidden, 1, 65536, "width of the head of vertices"},
      {"network.light_width", &c->light_width, 1, 65536, "of the six layers of the head of light"},
      {"network.template_level", &c->template_level, 0, 6,
       "subdivisions of the icosahedron; 3: 642 vertices"},
      {"network.template_radius", &c->template_radius, 1e-3, 10, "world units"},
      {"network.smoothing", &c->smoothing, 0, 64,
       "rounds of diffusion over the template that offsets go through"},
      {"network.symmetric", &c->symmetric, 0, 1, "every shape is symmetric at x = 0"},
      {"network.normalize", &c->normalize, 0, 1,
       "centre and scale every shape; else it learns its size and place"},
      {"network.symmetric_texture", &c->symmetric_texture, 0, 1, "and so is every texture"},
      {"network.lookup", &c->lookup, 0, 1,
       "texels are looked up in the picture, too, by a camera that the network learns to say"},
      {"network.lookup_width", &c->lookup_width, 1, 4096, "channels of the layers that mix them"},
      {"network.output_deviation", &c->output_deviation, 0, 10,
       "the last weights of vertices start as N(0, this^2)"},
  };
}

ConfigFields FieldsOf(ColorRule* c) {
  return {
      {"loss.color_masked", &c->masked, 0, 1,
       "colours are compared where the true object is, not beside it"},
      {"loss.color_from", &c->from, 0, 1, "share of the run after which colours count"},
      {"loss.color_soft", &c->soft, 0, 10,
       "differences below this count by their square; 0: none do"},
      {"loss.color_soft_until", &c->soft_until, 0, 1, "share of the run after which none do"},
      {"loss.color_own", &c->own, 0, 1,
       "weight of colours in a picture's own view, beside those in the other one"},
      {"loss.pose", &c->pose, 0, kNoLimit, "weight of the camera's error; network.lookup"},
  };
}

}  // namespace

Status CheckConfig(const TexturedImageConfig& config) {
  TILEGRAD_TRY(CheckConfig(config.light));
  const std::string& rule = config.render.rule;
  if (rule != "dibr" && rule != "n3mr") {
    return InvalidArgument("render.rule is \"{}\", but textures are drawn by \"dibr\" or \"n3mr\"",
                           rule);
  }
  const Lighting lighting = LightingOf(config.light);
  if (rule == "dibr" || lighting == Lighting::kNone || lighting == Lighting::kLambert) return {};
  return InvalidArgument("N3MR has no light.model = \"{}\": \"none\" or \"lambert\"",
                         config.light.model);
}

TextureNetworkConfig NetworkOf(const TexturedImageConfig& config) {
  TextureNetworkConfig network = config.network;
  network.cubes = IsN3mr(config);
  return network;
}

bool IsN3mr(const TexturedImageConfig& config) { return config.render.rule == "n3mr"; }

LightHeadShape LightHeadOf(const LightConfig& config) {
  return {LightingOf(config), config.shininess_low, config.shininess_high, config.spread <= 90};
}

ConfigFields FieldsOf(TexturedImageConfig* c) {
  ConfigFields render = FieldsOf(&c->render);
  for (ConfigField& field : render) {
    if (field.key == "render.rule") field.help = "whose renderer trains: \"dibr\" or \"n3mr\"";
  }
  ConfigFields fields;
  for (const ConfigFields& more :
       {FieldsOf(&c->network), FieldsOf(&c->loss), FieldsOf(&c->color), FieldsOf(&c->adversary),
        render, FieldsOf(&c->light), FieldsOf(&c->optimizer),
        ConfigFields{{"start.run", &c->start, 0, 0,
                      "folder of a run whose network this one starts as; \"\": a new one"},
                     {"schedule.batch", &c->batch, 1, 65536,
                      "objects a step, each in two views under two lights"}},
        FieldsOf(&c->stream)})
    fields.insert(fields.end(), more.begin(), more.end());
  return fields;
}

}  // namespace tilegrad::train
