// SPDX-License-Identifier: Apache-2.0
#include "render/shading/run.h"

#include "base/clocks.h"
#include "shade/normalize.h"
#include "shade/phong.h"

namespace tilegrad {
namespace {

using shade::RunPlane;

std::size_t Padded(std::size_t count) {
  return (count + shade::kRunPad - 1) / shade::kRunPad * shade::kRunPad;
}

template <std::size_t kPlanes>
void ClearPlanes(std::size_t count, RunPlane (&planes)[kPlanes]) {
  for (RunPlane& p : planes) std::fill_n(p.at, Padded(count), 0.0f);
}

void Multiply(std::size_t count, const RunPlane& by, RunPlane (&planes)[3]) {
  for (RunPlane& p : planes) {
    for (std::size_t i = 0; i < Padded(count); ++i) p.at[i] *= by.at[i];
  }
}

shade::TextureInput TextureInputOf(const RunScene& scene, const RunValues& v) {
  return {scene.texture->levels(), scene.texture->view().wrap, scene.texture->view().filter, v.uv,
          &v.level};
}

shade::RunLights LightsOf(const RunScene& scene, const RunValues& v) {
  if (scene.lights.empty()) return {{}, v.unit_light};
  return {scene.lights, nullptr};
}

shade::PhongInput PhongInputOf(const RunScene& scene, const RunValues& v) {
  return {v.unit, v.eye, LightsOf(scene, v), scene.surface->shininess};
}

bool HasSh(const RunScene& scene) {
  return scene.shading->lighting == Lighting::kSphericalHarmonics;
}

void LightRun(std::size_t count, const ShadeSteps& steps, const RunScene& scene, RunValues* v) {
  if (HasSh(scene)) {
    shade::ShLight(count, v->unit, *scene.sh, &v->light);
    return;
  }
  if (scene.lights.empty()) {
    shade::Normalize(count, v->light_direction, shade::kLeastUnitSquare, v->unit_light,
                     &v->inverse_light);
  }
  shade::Lambert(count, v->unit, LightsOf(scene, *v), &v->light);
  if (!steps.highlight) return;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < Padded(count); ++i) {
      v->eye[c].at[i] = scene.eye[c] - v->position[c].at[i];
    }
  }
  shade::Normalize(count, v->eye, shade::kLeastWorldSquare, v->eye, &v->inverse_eye);
  shade::Phong(count, PhongInputOf(scene, *v), &v->highlight);
}

shade::CombineInput CombineInputOf(const ShadeSteps& steps, const RunScene& scene,
                                   const RunValues& v, bool vertex_color) {
  return {.factors = scene.factors(),
          .texture = scene.texture != nullptr ? v.texture : nullptr,
          .vertex_color = vertex_color ? v.vertex_color : nullptr,
          .light = steps.light ? &v.light : nullptr,
          .highlight = steps.highlight ? &v.highlight : nullptr,
          .clamp = scene.shading->clamp};
}

// From I_l and I_s to normals, lights and the eye. d->unit is added to.
void LightAdjoint(std::size_t count, const BackwardPlan& plan, const RunScene& scene,
                  const RunValues& v, const RunTargets& out) {
  RunCotangents* const d = out.d;
  RunPlane* const d_unit = plan.to_normal ? d->unit : nullptr;
  if (HasSh(scene)) {
    shade::ShLightAdjoint(count, v.unit, *scene.sh, d->light, d_unit,
                          plan.wishes.sh ? &out.scene->sh : nullptr);
    return;
  }
  const bool per_pixel = scene.lights.empty() && plan.to_light_vectors;
  if (per_pixel) ClearPlanes(count, d->light_direction);
  shade::RunLightAdjoint lights{d_unit, {}, per_pixel ? d->light_direction : nullptr};
  if (plan.wishes.lights && !scene.lights.empty()) lights.uniform = out.scene->lights;
  if (plan.to_light) shade::LambertAdjoint(count, v.unit, LightsOf(scene, v), d->light, lights);
  if (plan.steps.highlight) {
    if (plan.to_eye) ClearPlanes(count, d->eye);
    shade::PhongAdjointOf(count, PhongInputOf(scene, v), d->highlight,
                          {lights, plan.to_eye ? d->eye : nullptr,
                           plan.to_surfaces ? &out.surface->shininess : nullptr});
  }
  if (per_pixel) {
    shade::NormalizeAdjoint(count, v.unit_light, v.inverse_light, d->light_direction,
                            d->light_direction);
  }
}

// d_position and the camera's part; V points from the surface to the eye.
void EyeAdjoint(std::size_t count, const RunValues& v, const RunTargets& out) {
  RunCotangents* const d = out.d;
  shade::NormalizeAdjoint(count, v.eye, v.inverse_eye, d->eye, d->eye);
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) {
      d->position[c].at[i] = -d->eye[c].at[i];
      sum += static_cast<double>(d->eye[c].at[i]);
    }
    out.scene->eye[c] += sum;
  }
}

void ColorAdjoint(std::size_t count, const BackwardPlan& plan, const RunScene& scene,
                  const RunValues& v, const RunTargets& out) {
  RunCotangents* const d = out.d;
  const bool textured = scene.texture != nullptr;
  const bool lit = plan.to_light && plan.steps.light;
  shade::CombineAdjointOf(
      count, CombineInputOf(plan.steps, scene, v, plan.recomputed[Varying::kColor]), d->color,
      {.d_texture = textured && (plan.to_uv || plan.to_texture) ? d->texture : nullptr,
       .d_vertex_color = plan.to_colors ? d->vertex_color : nullptr,
       .d_light = lit ? &d->light : nullptr,
       .d_highlight = plan.steps.highlight ? &d->highlight : nullptr,
       .d_factors = plan.to_surfaces ? &out.surface->factors : nullptr});
  if (textured && (plan.to_uv || plan.to_texture)) {
    shade::SampleTextureAdjoint(count, TextureInputOf(scene, v), d->texture,
                                plan.to_uv ? d->uv : nullptr, out.shares);
  } else if (plan.to_uv) {
    ClearPlanes(count, d->uv);
  }
  if (plan.to_light || (plan.to_surfaces && plan.steps.highlight))
    LightAdjoint(count, plan, scene, v, out);
}

}  // namespace

shade::ColorFactors RunScene::factors() const {
  shade::ColorFactors out{surface->base_color, surface->ambient, surface->diffuse,
                          surface->specular};
  if (shading->lighting == Lighting::kSphericalHarmonics) {
    out.ambient = {0, 0, 0};
    out.diffuse = {1, 1, 1};
  }
  return out;
}

void ColorRun(std::size_t count, const ForwardPlan& plan, const RunScene& scene, RunValues* v) {
  shade::Combine(count, CombineInputOf(plan.steps, scene, *v, plan.varyings[Varying::kColor]),
                 v->color);
}

void SceneSums::Clear(std::size_t surface_count, std::size_t light_count) {
  surfaces.assign(surface_count, {});
  lights.assign(light_count, shade::kNoLight<double>);
  sh = {};
  eye = {};
  depth_axis = {};
  depth_shift = 0;
}

void ShadeWork::Add(const ShadeWork& other) {
  pixels += other.pixels;
  lookups += other.lookups;
  normals += other.normals;
  lit += other.lit;
  highlights += other.highlights;
  gather += other.gather;
  normal += other.normal;
  texture += other.texture;
  light += other.light;
  color += other.color;
  adjoint += other.adjoint;
  scatter += other.scatter;
}

void ShadeRun(std::size_t count, const ShadeSteps& steps, const RunScene& scene, RunValues* v,
              ShadeWork* work) {
  StageClock clock;
  const auto pixels = static_cast<std::int64_t>(count);
  if (steps.normal) {
    if (steps.turn) Multiply(count, v->side, v->normal);
    shade::Normalize(count, v->normal, shade::kLeastUnitSquare, v->unit, &v->inverse_length);
    work->normals += pixels;
    clock.Lap(&work->normal);
  }
  if (steps.texture && scene.texture != nullptr) {
    shade::SampleTexture(count, TextureInputOf(scene, *v), v->texture);
    work->lookups += pixels;
    clock.Lap(&work->texture);
  }
  if (!steps.light) return;
  LightRun(count, steps, scene, v);
  work->lit += pixels;
  work->highlights += steps.highlight ? pixels : 0;
  clock.Lap(&work->light);
}

void ShadeRunAdjoint(std::size_t count, const BackwardPlan& plan, const RunScene& scene,
                     const RunValues& v, const RunTargets& out) {
  RunCotangents* const d = out.d;
  if (!plan.wishes.d_normals) ClearPlanes(count, d->unit);
  if (plan.steps.color) ColorAdjoint(count, plan, scene, v, out);
  if (plan.to_eye) {
    EyeAdjoint(count, v, out);
  } else if (plan.pulled[Varying::kPosition]) {
    ClearPlanes(count, d->position);
  }
  if (!plan.pulled[Varying::kNormal]) return;
  shade::NormalizeAdjoint(count, v.unit, v.inverse_length, d->unit, d->normal);
  if (plan.steps.turn) Multiply(count, v.side, d->normal);
}

}  // namespace tilegrad
