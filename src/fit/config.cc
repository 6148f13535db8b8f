// SPDX-License-Identifier: Apache-2.0
#include "fit/config.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/rng.h"
#include "fit/material.h"
#include "nn/optim.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {
namespace {

constexpr double kDeltaShare = 0.7;   // of the run, until delta is what it ends at
constexpr double kFinalPixels = 0.3;  // of the default delta
constexpr double kHullPixels = 0.7, kWideDelta = 3e-3;  // softness at the start
constexpr int kSphereLevels = 3;
// What a hull has too much of, tents on flat sides, has more area than what is right; masks hold
// the rest. At 1 thin things vanish.
constexpr double kHullArea = 0.3;
constexpr double kLateLight = 0.1;                     // rate of light once colours move
constexpr double kFullShare = 0.45, kHalfShare = 0.3;  // of the run at each of the finest levels

constexpr std::size_t kFirstRates = 8;

// By value, as the options of tilegrad fit call them.
constexpr std::array kMaterials = {"unlit", "lambert", "phong"};
constexpr std::array kLightings = {"none", "lambert", "phong", "sh"};
constexpr std::array kStarts = {"auto", "hull", "sphere"};
constexpr std::array kCutouts = {"off", "auto", "on"};
constexpr std::array kFilters = {"nearest", "bilinear", "trilinear"};

template <class Names, class Value>
std::string NameIn(const Names& names, Value value) {
  return names[static_cast<std::size_t>(value)];
}

double DeltaOf(double pixels, ImageSize size) {
  const double ndc = pixels * 2 / std::max(size.width, size.height);
  return ndc * ndc;
}

double FinalDelta(const FitConfig& config, ImageSize size) {
  return config.delta > 0 ? config.delta : DeltaOf(kFinalPixels, size);
}

// The coarsest level that the sizes allow.
int LevelsOf(const FitConfig& config, ImageSize size) {
  int levels = 1;
  while (levels < config.levels && size.width % (1 << levels) == 0 &&
         size.height % (1 << levels) == 0) {
    ++levels;
  }
  return levels;
}

ConfigFields FieldsOfDescent(FitConfig* c) {
  return {
      {"steps", &c->steps, 1, 1e7, "maximum number of gradient steps"},
      {"stop_gain", &c->stop_gain, 0, 1,
       "relative decrease of the loss over 100 steps, below which the fit stops early; 0: take all "
       "steps"},
      {"views_per_step", &c->views_per_step, 1, 1e6, "images per step"},
      {"levels", &c->levels, 0, 8,
       "resolution levels, coarse to fine, each twice the one before; 0: chosen for the initial "
       "shape"},
      {"delta_start", &c->delta_start, 0, 1e3,
       "softness of silhouettes at the start, squared NDC; 0: chosen for the initial shape"},
      {"delta", &c->delta, 0, 1e3,
       "softness of silhouettes at the end, squared NDC; 0: 0.3 pixels"},
      {"texture_size", &c->texture_size, 2, 8192, "width and height of a new texture, texels"},
      {"mask_tolerance", &c->mask_tolerance, 0, 0.5,
       "fraction of the masks that may miss a point of the hull, for masks with gaps"},
      {"template_level", &c->template_level, 0, 7,
       "subdivision level of the sphere: 3 has 642 vertices, 4 has 2562"},
      {"smoothing", &c->smoothing, 0, 1e4,
       "smoothing of vertex steps (lambda of Large Steps); 0: none"},
  };
}

ConfigFields FieldsOfRegularizers(FitConfig* c) {
  ConfigFields fields = FieldsOf(&c->regularizers, "");
  for (ConfigField& field : fields) {
    if (field.key == "smoothness") field.key = "flatness";  // "smoothing" is another option
    if (field.key != "area") continue;
    field.low = -1;
    field.help = "weight of the surface area; -1: chosen for the initial shape";
  }
  return fields;
}

ConfigFields FieldsOfRun(FitConfig* c) {
  const auto reporting = Affects::kReporting;
  return {
      {"color_weight", &c->loss.color_weight, 0, 1e6, "weight of the L1 loss of colours"},
      {"silhouette_weight", &c->loss.silhouette_weight, 0, 1e6, "weight of the IoU loss of masks"},
      {"perturb_cameras", &c->perturb_cameras, 0, 180,
       "rotate each camera by this many degrees in a random direction, to test camera refinement"},
      {"seed", &c->seed, 0, kNoLimit, "seed of the choice of images"},
      {"checkpoint_every", &c->checkpoint_every, 1, 1e9, "steps", reporting},
      {"timelapse", &c->timelapse, 0, 1e6, "number of timelapse frames; 0: none", reporting},
  };
}

}  // namespace

ConfigFields FieldsOf(FitConfig* c) {
  return Joined({FieldsOfDescent(c), FieldsOfRegularizers(c), FieldsOfRun(c)});
}

Result<std::int64_t> StepsOfQuality(std::string_view quality) {
  if (quality == "fast") return std::int64_t{300};
  if (quality == "normal") return FitConfig().steps;
  if (quality == "best") return std::int64_t{3000};
  return InvalidArgument("quality is \"{}\", expected fast, normal or best", quality);
}

std::string DescribeConfig(const FitConfig& config) {
  FitConfig c = config;
  std::string names;
  for (const Parameter p : kParameters) {
    if (c.parameters[p]) names += fmt::format("{}{}", names.empty() ? "" : ",", NameOf(p));
  }
  std::string out = ResultSettings(FieldsOf(&c));
  const auto line = [&out](const char* key, const auto& value) {
    out += fmt::format("{} = {}\n", key, value);
  };
  line("parameters", names);
  if (c.material != MaterialKind::kUnlit) line("material", NameIn(kMaterials, c.material));
  if (c.cutout != Cutout::kAuto) line("cutout", NameIn(kCutouts, c.cutout));
  line("lighting", NameIn(kLightings, c.lighting));
  line("light_direction", fmt::format("{}", fmt::join(c.light_direction, ",")));
  line("start", NameIn(kStarts, c.start));
  line("filter", NameIn(kFilters, c.filter));
  line("vertex_colors", c.vertex_colors);
  line("max_alpha_error", c.max_alpha_error);
  // Fits older than these parameters can be resumed.
  line("rates", fmt::format("{}", fmt::join(std::span(c.rates.of).first(kFirstRates), ",")));
  for (const Parameter p : {Parameter::kExposure, Parameter::kFocal}) {
    if (c.parameters[p]) line(fmt::format("rate_{}", NameOf(p)).c_str(), c.rates[p]);
  }
  line("final_rate", c.final_rate);
  return out;
}

FitConfig ResolveDefaults(FitConfig config, bool from_hull, ImageSize size) {
  if (config.levels == 0) config.levels = from_hull ? 1 : kSphereLevels;
  if (config.delta_start == 0)
    config.delta_start = from_hull ? DeltaOf(kHullPixels, size) : kWideDelta;
  if (config.regularizers.area < 0) config.regularizers.area = from_hull ? kHullArea : 0;
  SetMaterial(from_hull, &config);
  return config;
}

double EarliestStopTime(const FitConfig& config) {
  double time = std::max(config.cameras_rest, config.texture_rest);
  if (config.levels > 1) time = std::max(time, 1 - kFullShare);
  return time;
}

FitSchedule ScheduleAt(const FitConfig& config, double t, ImageSize size) {
  FitSchedule out;
  const int levels = LevelsOf(config, size);
  if (levels > 1 && t < 1 - kFullShare) out.factor = 2;
  const double coarse = 1 - kFullShare - kHalfShare;
  if (levels > 2 && t < coarse) {
    // The coarser levels share what is left evenly.
    const int left = static_cast<int>((coarse - t) / coarse * (levels - 2));
    out.factor = 4 << std::min(left, levels - 3);
  }
  const double end = FinalDelta(config, size), start = std::max(config.delta_start, end);
  out.delta = nn::Geometric(start, end, t / kDeltaShare);
  const bool resting = t < config.texture_rest;
  out.texture_rate = resting ? 0 : 1;
  out.light_rate = config.texture_rest == 0 || resting ? 1 : kLateLight;
  out.position_rate = resting && config.levels == 1 ? 0 : 1;
  out.camera_rate = t < config.cameras_rest ? 0 : 1;
  out.rate = nn::HalfCosine(config.final_rate, t);
  return out;
}

bool ShowsAt(const FitConfig& config, std::int64_t step) {
  const std::int64_t count = config.timelapse - 1, steps = config.steps;
  if (config.timelapse <= 0) return false;
  if (step == 0 || step == steps || count <= 0) return step == 0 || step == steps;
  return step * count / steps != (step - 1) * count / steps;
}

std::vector<int> ViewsAt(const FitConfig& config, std::int64_t step, std::span<const int> from) {
  std::vector<int> views(from.begin(), from.end());
  const std::size_t count = std::min(static_cast<std::size_t>(config.views_per_step), views.size());
  Rng rng(static_cast<std::uint64_t>(config.seed), static_cast<std::uint64_t>(step));
  for (std::size_t i = 0; i < count; ++i) {
    std::swap(views[i], views[i + rng.Below(views.size() - i)]);
  }
  views.resize(count);
  std::sort(views.begin(), views.end());
  return views;
}

}  // namespace tilegrad::train
