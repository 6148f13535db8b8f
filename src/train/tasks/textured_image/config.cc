// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/config.h"

#include "base/error.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(TextureNetworkConfig* c) {
  return Joined(
      {FieldsOf(UNetKeys{&c->base, &c->most, &c->levels, &c->enlarge, &c->skips, &c->latent}),
       {{"network.hidden", &c->hidden, 1, 65536, "width of the head of vertices"},
        {"network.light_width", &c->light_width, 1, 65536,
         "of the six layers of the head of light"}},
       FieldsOf(&c->sphere),
       {{"network.normalize", &c->normalize, 0, 1,
         "centre and scale every shape; else it learns its size and place"},
        {"network.symmetric_texture", &c->symmetric_texture, 0, 1, "and so is every texture"},
        {"network.lookup", &c->lookup, 0, 1,
         "texels are looked up in the picture, too, by a camera that the network learns to say"},
        {"network.lookup_width", &c->lookup_width, 1, 4096, "channels of the layers that mix them"},
        {"network.palette", &c->palette, 0, 64,
         "paints that texels are shared out among, whose colours are read from the picture"},
        OutputDeviation(&c->output_deviation)}});
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
      {"loss.light", &c->light, 0, kNoLimit,
       "weight of the distance to the light that explains a picture best"},
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
  return {LightingOf(config), config.shininess_low, config.shininess_high,
          WidestAngle(config) <= 90};
}

ConfigFields FieldsOf(TexturedImageConfig* c) {
  ConfigFields render = FieldsOf(&c->render);
  for (ConfigField& field : render) {
    if (field.key == "render.rule") field.help = "whose renderer trains: \"dibr\" or \"n3mr\"";
  }
  return Joined({FieldsOf(&c->network),
                 FieldsOf(&c->loss),
                 FieldsOf(&c->color),
                 FieldsOf(&c->adversary),
                 render,
                 FieldsOf(&c->light),
                 FieldsOf(&c->optimizer),
                 {{"start.run", &c->start, 0, 0,
                   "folder of a run whose network this one starts as; \"\": a new one"},
                  {"schedule.batch", &c->batch, 1, 65536,
                   "objects a step, each in two views under two lights"}},
                 FieldsOf(&c->stream)});
}

}  // namespace tilegrad::train
