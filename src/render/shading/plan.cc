// SPDX-License-Identifier: Apache-2.0
#include "render/shading/plan.h"

#include <fmt/format.h>

namespace tilegrad {
namespace {

Rate RateOf(const SceneParts& parts, Varying v) {
  const Normals normals = parts.shading.normals;
  if (v != Varying::kNormal || normals == Normals::kGiven) {
    return parts.rates[static_cast<std::size_t>(v)];
  }
  return normals == Normals::kFlat ? Rate::kCorner : Rate::kVertex;
}

// Corner rate if any of them has it.
void Finish(const SceneParts& parts, VaryingSet* set) {
  set->user_channels = parts.user_channels;
  for (std::size_t i = 0; i < kVaryings; ++i) {
    const auto v = static_cast<Varying>(i);
    if (set->width(v) == 0) set->has[i] = false;
    if (set->has[i] && RateOf(parts, v) == Rate::kCorner) {
      set->rate = Rate::kCorner;
    }
  }
}

// Whether the colour image is just the interpolated colours.
bool IsPlainColor(const SceneParts& parts) {
  return parts[Varying::kColor] && !parts.textures && !parts.surfaces && !parts.lit() &&
         !parts.shading.clamp;
}

bool IsOnly(const VaryingSet& set, Varying v) {
  VaryingSet only = set;
  only.has = {};
  only[v] = true;
  return set == only;
}

ShadeSteps ColorSteps(const SceneParts& parts) {
  return {.color = true,
          .texture = parts.textures,
          .level = parts.textures && parts.trilinear,
          .normal = parts.lit(),
          .light = parts.lit(),
          .highlight = parts.shading.lighting == Lighting::kPhong};
}

// Flips normals at the end of their computation.
void TurnNormals(const SceneParts& parts, ShadeSteps* steps) {
  steps->turn = steps->normal && parts.shading.two_sided;
}

// Whether a requested gradient flows through normals.
bool WantsNormals(const BackwardPlan& plan) {
  const bool given = plan.parts.shading.normals == Normals::kGiven;
  return plan.geometry || (plan.wishes[given ? Varying::kNormal : Varying::kPosition]);
}

void SetColorTargets(BackwardPlan* plan) {
  const SceneParts& parts = plan->parts;
  const GradientWishes& wishes = plan->wishes;
  const bool geometry = plan->geometry;
  plan->to_colors = parts[Varying::kColor] && (geometry || wishes[Varying::kColor]);
  plan->to_uv = parts.textures && parts.bilinear && (geometry || wishes[Varying::kUv]);
  plan->to_texture = parts.textures && wishes.textures;
  plan->to_normal = parts.lit() && WantsNormals(*plan);
  plan->to_eye = parts.shading.lighting == Lighting::kPhong && geometry;
  plan->to_light_vectors =
      parts.uses_lights() && (wishes.lights || (parts[Varying::kLightDirection] &&
                                                (geometry || wishes[Varying::kLightDirection])));
  plan->to_light = plan->to_normal || plan->to_eye || plan->to_light_vectors ||
                   (parts.shading.lighting == Lighting::kSphericalHarmonics && wishes.sh);
  plan->to_surfaces = wishes.surfaces;
}

VaryingSet PulledVaryings(const BackwardPlan& plan) {
  const GradientWishes& wishes = plan.wishes;
  const bool geometry = plan.geometry;
  VaryingSet set;
  set[Varying::kColor] = plan.to_colors;
  set[Varying::kUv] = plan.to_uv || (wishes.d_uv && (geometry || wishes[Varying::kUv]));
  set[Varying::kNormal] = plan.to_normal || (wishes.d_normals && WantsNormals(plan));
  set[Varying::kPosition] = plan.to_eye || (wishes.d_depth && geometry);
  set[Varying::kLightDirection] = plan.to_light_vectors && plan.parts[Varying::kLightDirection] &&
                                  (geometry || wishes[Varying::kLightDirection]);
  set[Varying::kUser] = wishes.d_user && (geometry || wishes[Varying::kUser]);
  Finish(plan.parts, &set);
  return set;
}

// Whether the adjoint of colour needs the factors of light or surfaces.
bool PullsOnFactors(const BackwardPlan& plan) { return plan.to_light || plan.to_surfaces; }
bool PullsOnTexture(const BackwardPlan& plan) { return plan.to_uv || plan.to_texture; }

ShadeSteps RecomputedSteps(const BackwardPlan& plan) {
  const SceneParts& parts = plan.parts;
  ShadeSteps steps;
  if (plan.to_colors || PullsOnTexture(plan) || PullsOnFactors(plan)) {
    steps = ColorSteps(parts);
    // The highlight is a separate sum: colours and textures do not need its value.
    steps.highlight = steps.highlight && (parts.shading.clamp || PullsOnFactors(plan));
  }
  if (plan.wishes.d_normals && WantsNormals(plan)) steps.normal = true;
  TurnNormals(parts, &steps);
  return steps;
}

VaryingSet RecomputedVaryings(const BackwardPlan& plan) {
  const SceneParts& parts = plan.parts;
  const ShadeSteps& steps = plan.steps;
  VaryingSet set;
  set[Varying::kColor] = steps.color && parts[Varying::kColor] &&
                         (parts.shading.clamp || PullsOnTexture(plan) || PullsOnFactors(plan));
  set[Varying::kUv] = steps.texture;
  set[Varying::kNormal] = steps.normal;
  set[Varying::kPosition] = steps.highlight || (plan.wishes.d_depth && plan.wishes.camera);
  set[Varying::kLightDirection] =
      steps.light && parts.uses_lights() && parts[Varying::kLightDirection];
  Finish(parts, &set);
  return set;
}

// For all but the user's channels.
constexpr std::array<int, kVaryings> kWidths = [] {
  std::array<int, kVaryings> out = {};
  Scene scene;
  SceneGradients d;
  ForEachStreamField<float>(scene, d, [&](const char*, Varying what, int width, auto&, auto&) {
    out[static_cast<std::size_t>(what)] = width;
  });
  return out;
}();

}  // namespace

int VaryingSet::width(Varying v) const {
  if (!(*this)[v]) return 0;
  return v == Varying::kUser ? user_channels : kWidths[static_cast<std::size_t>(v)];
}

int VaryingSet::first(Varying v) const {
  int sum = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(v); ++i)
    sum += width(static_cast<Varying>(i));
  return sum;
}

int VaryingSet::channels() const { return first(Varying::kUser) + width(Varying::kUser); }

ForwardPlan PlanForward(const SceneParts& parts, const Outputs& request) {
  ForwardPlan plan;
  plan.parts = parts;
  plan.request = request;
  if (request.color) plan.steps = ColorSteps(parts);
  if (request.normals) plan.steps.normal = true;
  TurnNormals(parts, &plan.steps);
  VaryingSet& set = plan.varyings;
  set[Varying::kColor] = plan.steps.color && parts[Varying::kColor];
  set[Varying::kUv] = plan.steps.texture || (request.uv && parts[Varying::kUv]);
  set[Varying::kNormal] = plan.steps.normal;
  set[Varying::kPosition] = plan.steps.highlight;
  set[Varying::kLightDirection] =
      plan.steps.light && parts.uses_lights() && parts[Varying::kLightDirection];
  set[Varying::kUser] = request.attributes;
  Finish(parts, &set);
  plan.colors_only = IsPlainColor(parts) && IsOnly(set, Varying::kColor);
  plan.user_only = IsOnly(set, Varying::kUser) && !request.color;
  return plan;
}

bool BackwardPlan::staged() const {
  if (colors_only || user_only) return false;
  return pulled.channels() > 0 || to_texture || to_surfaces || to_light_vectors || wishes.sh ||
         to_eye || (wishes.d_depth && geometry);
}

BackwardPlan PlanBackward(const SceneParts& parts, GradientWishes wishes) {
  BackwardPlan plan;
  wishes.d_uv = wishes.d_uv && parts[Varying::kUv];
  plan.parts = parts;
  plan.wishes = wishes;
  plan.geometry = wishes[Varying::kPosition] || wishes.camera;
  if (wishes.d_color) SetColorTargets(&plan);
  plan.pulled = PulledVaryings(plan);
  plan.steps = RecomputedSteps(plan);
  plan.recomputed = RecomputedVaryings(plan);
  plan.colors_only = IsPlainColor(parts) && wishes.d_color &&
                     IsOnly(plan.pulled, Varying::kColor) && !plan.to_surfaces;
  plan.user_only =
      IsOnly(plan.pulled, Varying::kUser) && plan.recomputed.channels() == 0 && !wishes.d_color;
  return plan;
}

}  // namespace tilegrad
