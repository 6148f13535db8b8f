// SPDX-License-Identifier: Apache-2.0
#include "fit/scene.h"

#include <algorithm>

#include "base/error.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {
namespace {

// The renderer's gradient goes into `array` if it is wanted.
std::span<float> Wanted(bool wanted, std::size_t size, AlignedVector<float>* array) {
  if (!wanted) return {};
  array->resize(size);
  return *array;
}

}  // namespace

const char* NameOf(Parameter parameter) {
  static constexpr std::array kNames = {"positions", "colors", "texture",  "uv",       "camera",
                                        "light",     "sh",     "material", "exposure", "focal"};
  return kNames[static_cast<std::size_t>(parameter)];
}

bool ParameterSet::empty() const {
  return std::none_of(has.begin(), has.end(), [](bool b) { return b; });
}

std::string WhyExcluded(const FitScene& scene, Parameter parameter) {
  const bool textured = !scene.texture.empty();
  switch (parameter) {
    case Parameter::kColors:
      return scene.colors.empty() ? "the scene has no vertex colours" : "";
    case Parameter::kTexture:
      return textured ? "" : "the scene has no texture";
    case Parameter::kUv:
      if (!textured) return "the scene has no texture to look up";
      return scene.filter == Filter::kNearest
                 ? "the nearest texel does not depend on where in it a lookup falls: choose the "
                   "bilinear or trilinear filter"
                 : "";
    case Parameter::kLight:
      return scene.uses_lights() ? "" : "only Lambert and Phong light have a direction";
    case Parameter::kSh:
      return scene.shading.lighting == Lighting::kSphericalHarmonics
                 ? ""
                 : "the light is not made of spherical harmonics";
    case Parameter::kMaterial:
      return scene.uses_lights() ? "" : "only Lambert and Phong light read a material";
    case Parameter::kExposure:
      return scene.gains.size() > 1 ? "" : "there is one image, and nothing to compare it with";
    default:
      return "";
  }
}

void FitRenderer::SetScenes(const FitScene& scene, const Job& job) {
  Scene one;
  one.positions = scene.positions;
  one.faces = scene.faces;
  one.shading = scene.shading;
  if (!scene.colors.empty()) one.colors = {scene.colors, Rate::kVertex};
  if (!scene.texture.empty()) {
    corner_uvs_.resize(2 * scene.uv_indices.size());
    for (std::size_t i = 0; i < scene.uv_indices.size(); ++i) {
      const auto u = 2 * static_cast<std::size_t>(scene.uv_indices[i]);
      corner_uvs_[2 * i] = scene.uvs[u];
      corner_uvs_[2 * i + 1] = scene.uvs[u + 1];
    }
    one.uvs = {corner_uvs_, Rate::kCorner};
    texture_ = {scene.texture.pixels, scene.texture.width, scene.texture.height, scene.wrap,
                scene.filter};
    one.textures = {&texture_, 1};
  }
  if (scene.uses_lights()) {
    surface_ = scene.surface;
    surface_.texture = scene.texture.empty() ? -1 : 0;
    one.surfaces = {&surface_, 1};
    one.lights = scene.lights;
  }
  if (scene.shading.lighting == Lighting::kSphericalHarmonics) one.sh = scene.sh;
  scenes_.assign(job.views.size(), one);
  for (std::size_t n = 0; n < job.views.size(); ++n) {
    scenes_[n].camera =
        ScaledCamera(scene.cameras[static_cast<std::size_t>(job.views[n])], job.scale);
  }
}

Status FitRenderer::Render(const FitScene& scene, const Job& job) {
  SetScenes(scene, job);
  Outputs request;
  request.attributes = false;
  request.alpha = job.alpha;
  return renderer_.Render(scenes_, job.options, request, &frame_);
}

void FitRenderer::SetGradients(const FitScene& scene, const ParameterSet& wanted,
                               FitGradients* gradients) {
  SceneGradients d;
  d.positions =
      Wanted(wanted[Parameter::kPositions], scene.positions.size(), &gradients->positions);
  d.colors = Wanted(wanted[Parameter::kColors], scene.colors.size(), &gradients->colors);
  d.uvs =
      Wanted(wanted[Parameter::kUv] && !scene.texture.empty(), corner_uvs_.size(), &d_corner_uvs_);
  d_texture_ =
      Wanted(wanted[Parameter::kTexture], scene.texture.pixels.size(), &gradients->texture);
  if (!scene.texture.empty()) d.textures = {&d_texture_, 1};
  if (scene.uses_lights() && wanted[Parameter::kMaterial]) d.surfaces = {&gradients->surface, 1};
  if (scene.uses_lights() && wanted[Parameter::kLight]) {
    gradients->lights.resize(scene.lights.size());
    d.lights = gradients->lights;
  }
  if (scene.shading.lighting == Lighting::kSphericalHarmonics && wanted[Parameter::kSh]) {
    d.sh = gradients->sh;
  }
  d_scenes_.assign(scenes_.size(), d);
  if (!wanted[Parameter::kCamera] && !wanted[Parameter::kFocal]) return;
  gradients->cameras.resize(scenes_.size());
  for (std::size_t n = 0; n < scenes_.size(); ++n) d_scenes_[n].camera = &gradients->cameras[n];
}

// Corners that share coordinates add up, in the order of corners.
void FitRenderer::GatherUvs(const FitScene& scene, FitGradients* gradients) const {
  gradients->uvs.assign(scene.uvs.size(), 0.0f);
  for (std::size_t i = 0; i < scene.uv_indices.size(); ++i) {
    const auto u = 2 * static_cast<std::size_t>(scene.uv_indices[i]);
    gradients->uvs[u] += d_corner_uvs_[2 * i];
    gradients->uvs[u + 1] += d_corner_uvs_[2 * i + 1];
  }
}

Status FitRenderer::Backward(const FitScene& scene, const Job& job, const FrameGradients& d_frame,
                             const ParameterSet& wanted, FitGradients* gradients) {
  SetGradients(scene, wanted, gradients);
  TILEGRAD_TRY(renderer_.Backward(frame_, d_frame, d_scenes_));
  if (wanted[Parameter::kUv] && !scene.texture.empty()) GatherUvs(scene, gradients);
  if (!wanted[Parameter::kCamera] && !wanted[Parameter::kFocal]) return {};
  // Intrinsics were multiplied by the scale.
  for (Camera& d_camera : gradients->cameras) d_camera = ScaledCamera(d_camera, job.scale);
  gradients->focal = 0;
  for (std::size_t n = 0; n < job.views.size(); ++n) {
    const Camera& d = gradients->cameras[n];
    const Camera& camera = scene.cameras[static_cast<std::size_t>(job.views[n])];
    gradients->focal +=
        static_cast<double>(camera.fx * d.fx) + static_cast<double>(camera.fy * d.fy);
  }
  return {};
}

}  // namespace tilegrad::train
