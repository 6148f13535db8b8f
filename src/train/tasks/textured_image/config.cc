// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/config.h"

#include "base/error.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(TextureNetworkConfig* c) {
  return Joined(
      {FieldsOf(&c->code),
       {{"network.hidden", &c->hidden, 1, 65536, "width of the vertex head"},
        {"network.light_width", &c->light_width, 1, 65536,
         "width of the six layers of the light head"}},
       FieldsOf(&c->sphere),
       {{"network.normalize", &c->normalize, 0, 1,
         "centre and scale every shape; otherwise size and position are learned"},
        {"network.symmetric_texture", &c->symmetric_texture, 0, 1,
         "every texture is symmetric at x = 0"},
        {"network.lookup", &c->lookup, 0, 1,
         "also look up texels in the input image, through a camera that the network predicts"},
        {"network.lookup_width", &c->lookup_width, 1, 4096,
         "channels of the layers that blend looked-up and generated texels"},
        {"network.palette", &c->palette, 0, 64,
         "size of a colour palette read from the input image, from which texels are mixed; 0: "
         "none"},
        OutputDeviation(&c->output_deviation)}});
}

ConfigFields FieldsOf(ColorRule* c) {
  return {
      {"loss.color_masked", &c->masked, 0, 1, "compare colours only on pixels of the true object"},
      {"loss.color_from", &c->from, 0, 1, "fraction of the run after which the colour loss starts"},
      {"loss.color_soft", &c->soft, 0, 10,
       "colour differences below this are squared; 0: none are"},
      {"loss.color_soft_until", &c->soft_until, 0, 1, "fraction of the run after which none are"},
      {"loss.color_own", &c->own, 0, 1,
       "weight of colours in the input view, relative to the other view"},
      {"loss.light", &c->light, 0, kNoLimit,
       "weight of the distance to the best-fitting light of a picture"},
      {"loss.pose", &c->pose, 0, kNoLimit, "weight of the camera's error; needs network.lookup"},
  };
}

}  // namespace

Status CheckConfig(const TexturedImageConfig& config) {
  TILEGRAD_TRY(CheckConfig(config.light));
  const std::string& rule = config.render.rule;
  if (rule != "dibr" && rule != "n3mr")
    return InvalidArgument("render.rule is \"{}\", but must be \"dibr\" or \"n3mr\" for textures",
                           rule);
  const Lighting lighting = LightingOf(config.light);
  if (rule == "dibr" || lighting == Lighting::kNone || lighting == Lighting::kLambert) return {};
  return InvalidArgument("N3MR has no light.model = \"{}\"; use \"none\" or \"lambert\"",
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
    if (field.key == "render.rule") field.help = "training renderer: \"dibr\" or \"n3mr\"";
  }
  return Joined({FieldsOf(&c->network),
                 FieldsOf(&c->loss),
                 FieldsOf(&c->color),
                 FieldsOf(&c->adversary),
                 render,
                 FieldsOf(&c->light),
                 FieldsOf(&c->optimizer),
                 {{"start.run", &c->start, 0, 0,
                   "folder of a run whose network initialises this one; \"\": none"},
                  {"schedule.batch", &c->batch, 1, 65536,
                   "objects per step, each in two views under two lights"}},
                 FieldsOf(&c->stream)});
}

}  // namespace tilegrad::train
