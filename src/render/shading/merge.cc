// SPDX-License-Identifier: Apache-2.0
#include "render/shading/merge.h"

#include <algorithm>
#include <cstddef>
#include <string_view>

#include "shade/spherical_harmonics_ref.h"

namespace tilegrad {
namespace {

template <std::size_t kSize>
void AddAll(const std::array<double, kSize>& from, std::array<float, kSize>& to) {
  for (std::size_t i = 0; i < kSize; ++i) to[i] += static_cast<float>(from[i]);
}

template <std::size_t kSize>
void AddSums(const std::array<double, kSize>& from, std::array<double, kSize>& to) {
  for (std::size_t i = 0; i < kSize; ++i) to[i] += from[i];
}

void AddSurface(const SurfaceSums& from, SurfaceSums& to) {
  AddSums(from.factors.base, to.factors.base);
  AddSums(from.factors.ambient, to.factors.ambient);
  AddSums(from.factors.diffuse, to.factors.diffuse);
  AddSums(from.factors.specular, to.factors.specular);
  to.shininess += from.shininess;
}

void AddBand(const SceneSums& from, SceneSums& to) {
  for (std::size_t i = 0; i < to.surfaces.size(); ++i) AddSurface(from.surfaces[i], to.surfaces[i]);
  for (std::size_t i = 0; i < to.lights.size(); ++i) {
    AddSums(from.lights[i].direction, to.lights[i].direction);
    to.lights[i].intensity += from.lights[i].intensity;
  }
  AddSums(from.sh, to.sh);
  AddSums(from.eye, to.eye);
  AddSums(from.depth_axis, to.depth_axis);
  to.depth_shift += from.depth_shift;
}

void AddSurfaces(const StageScene& scene, const SceneSums& sums, std::span<Surface> d_surfaces) {
  const ShadingModel& shading = scene.scene->shading;
  const bool lit = UsesLights(shading);
  for (std::size_t i = 0; i < d_surfaces.size(); ++i) {
    const SurfaceSums& s = sums.surfaces[i];
    AddAll(s.factors.base, d_surfaces[i].base_color);
    if (lit) AddAll(s.factors.ambient, d_surfaces[i].ambient);
    if (lit) AddAll(s.factors.diffuse, d_surfaces[i].diffuse);
    if (shading.lighting != Lighting::kPhong) continue;
    AddAll(s.factors.specular, d_surfaces[i].specular);
    d_surfaces[i].shininess += static_cast<float>(s.shininess);
  }
}

// From unit directions to those of the caller.
void AddLights(const StageScene& scene, const SceneSums& sums, std::span<Light> d_lights) {
  for (std::size_t k = 0; k < d_lights.size(); ++k) {
    const auto& unit = scene.lights[k].direction;
    const auto& d = sums.lights[k];
    double along = 0;
    for (std::size_t i = 0; i < 3; ++i) along += d.direction[i] * static_cast<double>(unit[i]);
    for (std::size_t i = 0; i < 3; ++i) {
      const double across = d.direction[i] - along * static_cast<double>(unit[i]);
      d_lights[k].direction[i] +=
          static_cast<float>(across * static_cast<double>(scene.inverse_lengths[k]));
    }
    d_lights[k].intensity += static_cast<float>(d.intensity);
  }
}

// eye = -R^T t; depth: SceneSums.
void AddCamera(const StageScene& scene, const SceneSums& sums, Camera* d_camera) {
  const Camera& camera = scene.scene->camera;
  for (std::size_t r = 0; r < 3; ++r) {
    double d_translation = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      d_camera->rotation[3 * r + c] -=
          static_cast<float>(static_cast<double>(camera.translation[r]) * sums.eye[c]);
      d_translation -= static_cast<double>(camera.rotation[3 * r + c]) * sums.eye[c];
    }
    d_camera->translation[r] += static_cast<float>(d_translation);
  }
  for (std::size_t c = 0; c < 3; ++c) {
    d_camera->rotation[6 + c] += static_cast<float>(sums.depth_axis[c]);
  }
  d_camera->translation[2] += static_cast<float>(sums.depth_shift);
}

void AddSh(const StageScene& scene, const SceneSums& sums, std::span<float> d_sh) {
  if (d_sh.empty() || scene.scene->shading.lighting != Lighting::kSphericalHarmonics) return;
  std::array<double, 9> d = {};
  shade::ShPolynomialAdjoint<double>(sums.sh, d);
  for (std::size_t i = 0; i < 9; ++i) d_sh[i] += static_cast<float>(d[i]);
}

}  // namespace

void ClearUniforms(std::span<const SceneGradients> d_scenes) {
  for (const SceneGradients& d : d_scenes) {
    std::fill(d.sh.begin(), d.sh.end(), 0.0f);
    ForEachRecordPart(d, [](const char* record, const char*, std::span<float> part) {
      if (record != std::string_view("camera")) std::fill(part.begin(), part.end(), 0.0f);
    });
  }
}

void ClearTextures(std::span<const SceneGradients> d_scenes) {
  for (const SceneGradients& d : d_scenes) {
    for (const auto& texture : d.textures) std::fill(texture.begin(), texture.end(), 0.0f);
  }
}

void MergeUniforms(const ShadeStage& stage, std::span<const StageScene> scenes,
                   std::span<const SceneGradients> d_scenes, SceneSums* scratch) {
  SceneSums& sums = *scratch;
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    sums.Clear(scenes[n].surfaces.size(), scenes[n].lights.size());
    for (const StageBand& band : stage.bands(n)) AddBand(band.sums, sums);
    const SceneGradients& d = d_scenes[n];
    AddSurfaces(scenes[n], sums, d.surfaces);
    AddLights(scenes[n], sums, d.lights);
    AddSh(scenes[n], sums, d.sh);
    if (d.camera != nullptr) AddCamera(scenes[n], sums, d.camera);
  }
}

void TextureMerge::FindTargets(std::span<const StageScene> scenes,
                               std::span<const SceneGradients> d_scenes) {
  targets_.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    for (std::size_t t = 0; t < d_scenes[n].textures.size(); ++t) {
      const std::span<float> out = d_scenes[n].textures[t];
      if (out.empty()) continue;
      const auto known = std::find_if(targets_.begin(), targets_.end(), [&](const Target& target) {
        return target.out.data() == out.data();
      });
      const shade::TexturePyramid* pyramid = scenes[n].textures[t];
      if (known == targets_.end()) {
        targets_.push_back({out, pyramid});
      } else if (pyramid->sizes().size() > known->pyramid->sizes().size()) {
        known->pyramid = pyramid;  // one is mip-mapped: there is room for all of its levels
      }
    }
  }
  while (gradients_.size() < targets_.size()) {
    gradients_.push_back(std::make_unique<shade::TextureGradient>());
  }
}

void TextureMerge::Run(const ShadeStage& stage, std::span<const StageScene> scenes,
                       const Workers& workers, std::span<const SceneGradients> d_scenes) {
  FindTargets(scenes, d_scenes);
  workers.For(targets_.size(),
              [&](std::size_t i, std::size_t) { gradients_[i]->Clear(*targets_[i].pyramid); });
  // Each texel gets its sum in the order of scenes, bands and pixels, whatever the number of parts.
  const std::size_t parts = targets_.size() >= static_cast<std::size_t>(workers.count()) ? 1 : 4;
  workers.For(targets_.size() * parts, [&](std::size_t task, std::size_t) {
    const Target& target = targets_[task / parts];
    const shade::RowShare rows{static_cast<int>(task % parts), static_cast<int>(parts)};
    for (std::size_t n = 0; n < scenes.size(); ++n) {
      for (std::size_t t = 0; t < d_scenes[n].textures.size(); ++t) {
        if (d_scenes[n].textures[t].data() != target.out.data()) continue;
        for (const StageBand& band : stage.bands(n)) {
          gradients_[task / parts]->Scatter(band.shares[t], rows);
        }
      }
    }
  });
  workers.For(targets_.size(),
              [&](std::size_t i, std::size_t) { gradients_[i]->Finish(targets_[i].out); });
}

}  // namespace tilegrad
