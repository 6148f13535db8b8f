// SPDX-License-Identifier: Apache-2.0
#include "api/narrow_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "render/pipeline/validate.h"
#include "render/shading/validate.h"

namespace tilegrad {
namespace {

float Narrow(double x) {
  constexpr double kMost = std::numeric_limits<float>::max();
  if (std::abs(x) > kMost) return x > 0 ? INFINITY : -INFINITY;
  return static_cast<float>(x);
}

std::array<float, 3> Narrow(const std::array<double, 3>& v) {
  return {Narrow(v[0]), Narrow(v[1]), Narrow(v[2])};
}

Camera Narrow(const CameraT<double>& c) {
  Camera out;
  std::transform(c.rotation, c.rotation + 9, out.rotation, [](double x) { return Narrow(x); });
  std::transform(c.translation, c.translation + 3, out.translation,
                 [](double x) { return Narrow(x); });
  out.fx = Narrow(c.fx), out.fy = Narrow(c.fy), out.cx = Narrow(c.cx), out.cy = Narrow(c.cy);
  out.near_plane = Narrow(c.near_plane);
  return out;
}

Surface Narrow(const SurfaceT<double>& s) {
  return {Narrow(s.base_color), s.texture,          Narrow(s.ambient),
          Narrow(s.diffuse),    Narrow(s.specular), Narrow(s.shininess)};
}

shade::DirectionalLight Narrow(const shade::DirectionalLightT<double>& light) {
  return {Narrow(light.direction), Narrow(light.intensity)};
}

// A list that the batch owns.
template <class Item>
std::vector<Item>& Own(std::vector<std::unique_ptr<std::vector<Item>>>& lists) {
  lists.push_back(std::make_unique<std::vector<Item>>());
  return *lists.back();
}

}  // namespace

std::span<float> NarrowBatch::Copy(std::span<const double> values) {
  std::vector<float>& out = Own(arrays_);
  out.reserve(values.size());
  for (const double x : values) out.push_back(Narrow(x));
  return out;
}

ShadedScene NarrowBatch::Copy(const ShadedSceneT<double>& scene) {
  ShadedScene out;
  out.positions = Copy(scene.positions), out.faces = scene.faces;
  out.attributes = Copy(scene.attributes), out.channels = scene.channels, out.rate = scene.rate;
  out.camera = Narrow(scene.camera), out.model = scene.model;
  out.colors = {Copy(scene.colors.values), scene.colors.rate};
  out.uvs = {Copy(scene.uvs.values), scene.uvs.rate};
  out.normals = {Copy(scene.normals.values), scene.normals.rate};
  auto& textures = Own(textures_);
  for (const auto& t : scene.textures) {
    textures.push_back({Copy(t.texels), t.width, t.height, t.channels, t.wrap, t.filter});
  }
  auto& surfaces = Own(surfaces_);
  for (const auto& surface : scene.surfaces) surfaces.push_back(Narrow(surface));
  auto& lights = Own(lights_);
  for (const auto& light : scene.lights) lights.push_back(Narrow(light));
  out.textures = textures, out.surfaces = surfaces, out.lights = lights;
  out.face_surfaces = scene.face_surfaces;
  out.light_directions = Copy(scene.light_directions), out.sh = Copy(scene.sh);
  return out;
}

// Their sizes are what counts.
ShadedGradients NarrowBatch::Copy(const ShadedGradientsT<double>& d) {
  const auto sized = [&](std::span<double> array) -> std::span<float> {
    std::vector<float>& out = Own(arrays_);
    out.resize(array.size());
    return out;
  };
  ShadedGradients out;
  out.positions = sized(d.positions), out.attributes = sized(d.attributes);
  out.colors = sized(d.colors), out.uvs = sized(d.uvs), out.normals = sized(d.normals);
  out.light_directions = sized(d.light_directions), out.sh = sized(d.sh);
  auto& textures = Own(spans_);
  for (const auto& texture : d.textures) textures.push_back(sized(texture));
  auto& surfaces = Own(surfaces_);
  surfaces.resize(d.surfaces.size());
  auto& lights = Own(lights_);
  lights.resize(d.lights.size());
  out.textures = textures, out.surfaces = surfaces, out.lights = lights;
  return out;
}

NarrowBatch::NarrowBatch(std::span<const ShadedSceneT<double>> scenes) {
  for (const auto& scene : scenes) scenes_.push_back(Copy(scene));
}

Status NarrowBatch::Validate(const RenderOptions& options) const {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_TRY(ValidateShadedScenes(scenes_).status());
  std::vector<SceneView> views(scenes_.begin(), scenes_.end());
  return ValidateSceneNumbers(views);
}

Status NarrowBatch::ValidateBackward(const RenderOptions& options,
                                     const ShadedFrameT<double>& frame,
                                     const ShadedFrameGradientsT<double>& d_frame,
                                     std::span<const ShadedGradientsT<double>> d_scenes) {
  TILEGRAD_TRY(Validate(options));
  ShadedFrameGradients d;
  d.color = Copy(d_frame.color), d.alpha = Copy(d_frame.alpha);
  d.attributes = Copy(d_frame.attributes), d.normals = Copy(d_frame.normals);
  d.uv = Copy(d_frame.uv), d.depth = Copy(d_frame.depth);
  std::vector<ShadedGradients> gradients;
  for (const auto& d_scene : d_scenes) gradients.push_back(Copy(d_scene));
  TILEGRAD_TRY(ValidateShadedBackward(scenes_, options, d, gradients));
  TILEGRAD_TRY(CheckFinite("d_frame.alpha", d.alpha));
  return ValidateShadedCotangents(d, frame.face_ids);
}

}  // namespace tilegrad
