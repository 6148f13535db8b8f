// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/rivals.h"

#include <initializer_list>
#include <utility>

#include "base/error.h"

namespace tilegrad::train {
namespace {

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
