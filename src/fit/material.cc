// SPDX-License-Identifier: Apache-2.0
#include "fit/material.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "base/error.h"
#include "io/mesh_file.h"
#include "scene/light_frame.h"

namespace tilegrad::train {
namespace {

// Of the run, until the texture moves: a hull's normals are nearly right from the start.
constexpr double kHullRest = 0.15, kSphereRest = 0.4;
constexpr float kStartAmbient = 0.5f, kStartSpecular = 0.1f;
constexpr double kLeastMain = 0.05;  // of the mean

std::array<double, 3> MeanColor(const FitInput& input) {
  const std::size_t pixels = input.images.pixels();
  std::array<double, 3> sum = {};
  double weight = 0;
  for (const int view : input.training) {
    const auto n = static_cast<std::size_t>(view);
    for (std::size_t p = 0; p < pixels; ++p) {
      const double alpha = static_cast<double>(input.images.alpha[n * pixels + p]);
      weight += alpha;
      for (std::size_t c = 0; c < 3; ++c)
        sum[c] += alpha * static_cast<double>(input.images.color[(3 * n + c) * pixels + p]);
    }
  }
  for (double& s : sum) s = weight > 0 ? s / weight : 0.5;
  return sum;
}

double HarmonicLight(const std::array<float, 9>& sh, const glm::dvec3& d) {
  const std::array<double, 9> basis = HarmonicBasis({d.x, d.y, d.z});
  double sum = 0;
  for (std::size_t i = 0; i < 9; ++i) sum += basis[i] * static_cast<double>(sh[i]);
  return sum;
}

std::optional<MainLight> MainOfHarmonics(const FitScene& scene) {
  const glm::dvec3 slope(-scene.sh[3], -scene.sh[1], scene.sh[2]);
  const double length = glm::length(slope);
  if (!(kHarmonic1 * length > kLeastMain)) return std::nullopt;
  return MainLight{slope / length, glm::dvec3(HarmonicLight(scene.sh, slope / length))};
}

std::optional<MainLight> MainOfDirection(const FitScene& scene) {
  const glm::dvec3 d(scene.light[0], scene.light[1], scene.light[2]);
  const auto& [r, g, b] = scene.surface.diffuse;
  const double length = glm::length(d);
  if (!(length > 0) || !(std::max({r, g, b}) > static_cast<float>(kLeastMain))) return std::nullopt;
  MainLight out{d / length, {}};
  for (int c = 0; c < 3; ++c) {
    const auto i = static_cast<std::size_t>(c);
    out.facing[c] = static_cast<double>(scene.surface.ambient[i] + scene.surface.diffuse[i]);
  }
  return out;
}

void Multiply(std::span<float> colors, const glm::dvec3& by) {
  for (std::size_t i = 0; i < colors.size(); ++i)
    colors[i] = std::clamp(colors[i] * static_cast<float>(by[static_cast<int>(i % 3)]), 0.0f, 1.0f);
}

}  // namespace

Status CheckMaterial(const FitConfig& config) {
  if (config.material == MaterialKind::kUnlit || config.lighting == Lighting::kNone) return {};
  return InvalidArgument("a lit material learns its own light: leave out the lighting");
}

void SetMaterial(bool from_hull, FitConfig* config) {
  if (config->material == MaterialKind::kUnlit) return;
  const bool phong = config->material == MaterialKind::kPhong;
  config->lighting = phong ? Lighting::kPhong : Lighting::kSphericalHarmonics;
  config->texture_rest = from_hull ? kHullRest : kSphereRest;
}

ParameterSet LightParameters(MaterialKind material) {
  ParameterSet set;
  set[Parameter::kSh] = material == MaterialKind::kLambert;
  set[Parameter::kLight] = set[Parameter::kMaterial] = material == MaterialKind::kPhong;
  return set;
}

void StartMaterial(const FitInput& input, bool blank, FitScene* scene) {
  scene->light_mean_fixed = true;
  scene->surface.ambient.fill(kStartAmbient);
  scene->surface.diffuse.fill(kDirectionsPerMean * (1 - kStartAmbient));
  scene->surface.specular.fill(kStartSpecular);
  if (!blank) return;
  const std::array<double, 3> mean = MeanColor(input);
  const auto fill = [&](std::span<float> colors) {
    for (std::size_t i = 0; i < colors.size(); ++i) colors[i] = static_cast<float>(mean[i % 3]);
  };
  fill(scene->texture.pixels);
  fill(scene->colors);
}

std::optional<MainLight> MainLightOf(const FitScene& scene) {
  if (scene.uses_lights()) return MainOfDirection(scene);
  if (scene.shading.lighting == Lighting::kSphericalHarmonics) return MainOfHarmonics(scene);
  return std::nullopt;
}

Status SaveFittedGlb(const Path& file, const FitScene& scene) {
  const auto main = scene.light_mean_fixed ? MainLightOf(scene) : std::nullopt;
  if (!main) return io::SaveGlb(file, MeshOfScene(scene));
  FitScene shown = scene;
  Multiply(shown.texture.pixels, main->facing);
  Multiply(shown.colors, main->facing);
  return io::SaveGlb(file, MeshOfScene(shown), {.sun = main->direction});
}

}  // namespace tilegrad::train
