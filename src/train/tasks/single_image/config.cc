// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/config.h"

#include <initializer_list>
#include <utility>

#include "base/error.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(NetworkConfig* c) {
  return Joined(
      {{{"network.channels", &c->channels, 1, 4096,
         "channels of the first convolution; then 2x and 4x"},
        {"network.code", &c->code, 1, 65536, "width of the encoder's fully connected layers"},
        {"network.hidden1", &c->hidden1, 1, 65536, "width of each decoder's first layer"},
        {"network.hidden2", &c->hidden2, 1, 65536, "width of each decoder's second layer"}},
       FieldsOf(&c->sphere),
       {{"network.fc_norm", &c->fc_norm, 0, 1, "batch norm after hidden fully connected layers"},
        {"network.fc_deviation", &c->fc_deviation, 0, 10,
         "fully connected weights start as N(0, this^2); 0: uniform by fan-in"},
        {"network.output_deviation", &c->output_deviation, 0, 10,
         "the decoders' last weights start as N(0, this^2)"},
        {"network.color_bias", &c->color_bias, -1, 2,
         "initial vertex colours, without picture_colors"},
        {"network.picture_colors", &c->picture_colors, 0, 1,
         "look up vertex colours in the input image"},
        {"network.n3mr_vertices", &c->sphere.n3mr_vertices, 0, 1,
         "N3MR's sigmoids and centroid instead of offsets"}}});
}

ConfigFields ScheduleFields(SingleImageConfig* c) {
  return {
      {"schedule.batch", &c->batch, 2, 65536, "objects per step; batch norm needs two"},
      {"schedule.views", &c->views, 1, 64, "views rendered per object: its own and random others"},
      {"schedule.mirrored", &c->mirrored, 0, 1, "fraction of the objects mirrored left to right"},
  };
}

template <class Value>
using Words = std::initializer_list<std::pair<const char*, Value>>;

// The value of a word.
template <class Value>
Result<Value> ValueOfWord(const char* key, const std::string& word, const Words<Value>& words) {
  std::string known;
  for (const auto& [name, value] : words) {
    if (word == name) return value;
    known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", name);
  }
  return InvalidArgument("{} is \"{}\", but must be one of {}", key, word, known);
}

}  // namespace

Status CheckConfig(const SingleImageConfig& config) {
  const SphereConfig& n = config.network.sphere;
  if (n.n3mr_vertices && (n.smoothing > 0 || n.symmetric))
    return InvalidArgument(
        "network.n3mr_vertices has no offsets to smooth or mirror: network.smoothing must be 0 and "
        "network.symmetric false");
  return RivalOptions(config.render.rule, config.rivals).status();
}

ConfigFields FieldsOf(SingleImageConfig* c) {
  return Joined({FieldsOf(&c->network), FieldsOf(&c->loss), FieldsOf(&c->render),
                 FieldsOf(&c->optimizer), ScheduleFields(c), FieldsOf(&c->rivals),
                 FieldsOf(&c->stream)});
}

ConfigFields FieldsOf(RivalConfig* c) {
  return {
      {"softras.sigma", &c->softras.sigma, 1e-9, 1, "sigma of rule \"softras\", squared NDC units"},
      {"softras.late_sigma", &c->softras_late_sigma, 1e-6, 1,
       "factor on sigma after 60 % of the run; published training: 0.3"},
      {"softras.dist_eps", &c->softras.dist_eps, 1e-30, 0.4999,
       "probability below which a face is skipped at a pixel"},
      {"softras.distance", &c->softras_distance, 0, 0, "\"euclidean\", \"barycentric\", \"hard\""},
      {"softras.alpha", &c->softras_alpha, 0, 0, "\"product\", \"sum\", \"hard\""},
      {"softras.near", &c->softras.near_plane, 1e-9, 1e9,
       "near plane; nearer faces have no gradient, as published"},
      {"softras.far", &c->softras.far_plane, 1e-9, 1e9,
       "far plane; farther faces have no gradient, as published"},
      {"softras.exact_product", &c->softras.exact_product, 0, 1,
       "repair: no floor in the derivative of the product"},
      {"softras.gradient_beyond_planes", &c->softras.gradient_beyond_planes, 0, 1,
       "repair: faces beyond near and far have a gradient"},
      {"softras.color", &c->softras_color, 0, 1,
       "also render colours and train on the colour loss"},
      {"softras.gamma", &c->softras_colors.gamma, 1e-9, 1e3,
       "temperature of depth in the colour blend, as a fraction of (far - near)"},
      {"softras.position_gradient", &c->softras_colors.position_gradient, 0, 1,
       "repair: the full gradient of colours to x and y"},
      {"n3mr.reduction", &c->n3mr_reduction, 0, 0,
       "downsampling of rule \"n3mr\" from twice the size: \"mean\", \"bilinear\", \"none\""},
      {"n3mr.eps", &c->n3mr.eps, 1e-9, 1, "NDC units, added to each distance of the sweep"},
      {"n3mr.fill_back", &c->n3mr.fill_back, 0, 1, "draw back faces"},
      {"n3mr.near", &c->n3mr.near_plane, 1e-9, 1e9, "near plane"},
      {"n3mr.far", &c->n3mr.far_plane, 1e-9, 1e9, "far plane"},
      {"n3mr.floor_lines", &c->n3mr.floor_lines, 0, 1,
       "repair: skip lines that an edge just misses at the left and lower border"},
      {"n3mr.color", &c->n3mr_color, 0, 1, "also render face colours and train on the colour loss"},
  };
}

Result<std::optional<rivals::Options>> RivalOptions(const std::string& rule,
                                                    const RivalConfig& config) {
  using rivals::N3mrReduction, rivals::SoftAlpha, rivals::SoftDistance;
  rivals::Options out{
      .softras = config.softras, .softras_colors = config.softras_colors, .n3mr = config.n3mr};
  TILEGRAD_ASSIGN(const int kind, ValueOfWord<int>("render.rule", rule,
                                                   {{"dibr", 0}, {"softras", 1}, {"n3mr", 2}}));
  TILEGRAD_ASSIGN(out.softras.distance,
                  ValueOfWord<SoftDistance>("softras.distance", config.softras_distance,
                                            {{"euclidean", SoftDistance::kEuclidean},
                                             {"barycentric", SoftDistance::kBarycentric},
                                             {"hard", SoftDistance::kHard}}));
  TILEGRAD_ASSIGN(out.softras.alpha, ValueOfWord<SoftAlpha>("softras.alpha", config.softras_alpha,
                                                            {{"product", SoftAlpha::kProduct},
                                                             {"sum", SoftAlpha::kSum},
                                                             {"hard", SoftAlpha::kHard}}));
  TILEGRAD_ASSIGN(out.n3mr.reduction,
                  ValueOfWord<N3mrReduction>("n3mr.reduction", config.n3mr_reduction,
                                             {{"mean", N3mrReduction::kMean},
                                              {"bilinear", N3mrReduction::kBilinear},
                                              {"none", N3mrReduction::kNone}}));
  TILEGRAD_TRY(rivals::Validate(out));
  if (kind == 0) return std::optional<rivals::Options>();
  out.rule = kind == 1 ? rivals::Rule::kSoftRas : rivals::Rule::kN3mr;
  return std::optional<rivals::Options>(out);
}

double SoftRasSigmaAt(const RivalConfig& config, double share) {
  return config.softras.sigma * (share < 0.6 ? 1 : config.softras_late_sigma);
}

}  // namespace tilegrad::train
