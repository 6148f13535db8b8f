// SPDX-License-Identifier: Apache-2.0
// What a fit does, apart from its input: plain defaults that work for a textured object in the
// middle of masked images.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "fit/fitter.h"
#include "train/run/config_fields.h"

namespace tilegrad::train {

// kAuto: the visual hull where there are masks, at least kLeastHullViews views that are in no
// narrow cone, and cameras that are not fitted; the sphere otherwise, and where masks have no point
// in common.
enum class StartShape { kAuto, kHull, kSphere };
inline constexpr int kLeastHullViews = 4;

// What a surface does with light (fit/material.h). kUnlit: colours hold the light of the images,
// or FitConfig::lighting says all; kLambert: light of harmonics; kPhong: one direction, light from
// everywhere, and highlights.
enum class MaterialKind { kUnlit, kLambert, kPhong };

// Whether the texture is cut out, for wire and thin leaves (cutout.h). kAuto: if the fit starts
// from a hull and the masks have many narrow gaps.
enum class Cutout { kOff, kAuto, kOn };

struct FitConfig {
  ParameterSet parameters;  // none: positions, and the texture or colours that the start has
  MaterialKind material = MaterialKind::kUnlit;
  Lighting lighting = Lighting::kNone;
  std::array<float, 3> light_direction = {0.3f, 1.0f, 0.5f};  // towards it, world
  Filter filter = Filter::kBilinear;

  // The start, if no mesh is given.
  StartShape start = StartShape::kAuto;
  double mask_tolerance = 0;   // of the hull: the share of masks that may lack a point of it
  int template_level = 4;      // subdivisions of the icosahedron: 4 has 2,562 vertices
  bool vertex_colors = false;  // instead of a texture
  int texture_size = 512;  // texels a side; of a sphere: around, and half of it from pole to pole
  Cutout cutout = Cutout::kAuto;

  std::int64_t steps = 1200;  // the most
  // Where FitClock::kWindow steps at full resolution lower the images' loss by less than this share
  // of it, the fit goes to its end three times as fast (fit/clock.h). 0: never.
  double stop_gain = 0.03;
  int views_per_step = 4;
  std::int64_t seed = 1;
  // Of resolution, each half of the next; the last is the images' own. 0: one from a hull, which is
  // near the object everywhere, else 3.
  int levels = 0;
  // Of equation 5; falls geometrically to `delta` over 70 % of the run. 0: 0.7 pixels from a hull,
  // else 3e-3.
  double delta_start = 0;
  double delta = 0;  // 0: 0.3 pixels of the whole image; wider ones make shapes thinner
  double max_alpha_error = 1e-4;

  LearningRates rates;       // positions and cameras' translation: times the object's radius
  double final_rate = 0.05;  // of the first; rates fall by a half cosine
  double smoothing = 10;
  ImageLoss loss = {.silhouette = SilhouetteLoss::kSquared};
  // area: -1: 0.3 from a hull without hollows, 0.05 if that is thin, else 0; falls with rates.
  RegularizerWeights regularizers = {.area = -1};
  // Share of the steps until cameras move: those that are nearly right wait for shape and texture.
  // 0 where the start is the object's own shape.
  double cameras_rest = 0;
  // Share of the steps until colours move, where light is learned with them; and from a hull the
  // shape.
  double texture_rest = 0;
  double perturb_cameras = 0;  // degrees, each by a random turn about the object: for experiments

  std::int64_t checkpoint_every = 100;
  int timelapse = 24;  // pictures; 0: none
};

// The numbers that `tilegrad fit` has an option for, each with its range and help: "steps" is
// --steps. Positions and directions have rules of their own.
ConfigFields FieldsOf(FitConfig* config);

// The steps of "fast", "normal" and "best".
Result<std::int64_t> StepsOfQuality(std::string_view quality);

// One line "key = value" for each that shapes the result; two runs with the same lines and input
// do the same.
std::string DescribeConfig(const FitConfig& config);

// Replaces each 0 that stands for "chosen for the initial shape". Later functions need that.
FitConfig ResolveDefaults(FitConfig config, bool from_hull, ImageSize size);

// The time before which the loss must not stop the fit: resolutions are coarse, cameras frozen.
double EarliestStopTime(const FitConfig& config);

// The state of the schedules at a time of the run.
struct FitSchedule {
  int factor = 1;  // pixels of the images for a pixel of this step
  double delta = 0, rate = 1;
  double camera_rate = 1;  // of cameras, times `rate`: they rest until there is a shape to go by
  double texture_rate = 1, light_rate = 1, position_rate = 1;  // of those, times `rate`
};
// Levels that the sizes do not divide by are left out.
FitSchedule ScheduleAt(const FitConfig& config, double time, ImageSize size);

// Whether there is a picture after so many steps: spread evenly, the start and the end included.
bool ShowsAt(const FitConfig& config, std::int64_t step);

// The views of a step: different ones, a pure function of seed and step.
std::vector<int> ViewsAt(const FitConfig& config, std::int64_t step, std::span<const int> from);

}  // namespace tilegrad::train
