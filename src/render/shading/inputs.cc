// SPDX-License-Identifier: Apache-2.0
#include "render/shading/inputs.h"

#include <atomic>
#include <cstdint>
#include <utility>

#include "base/array_checks.h"
#include "base/clocks.h"
#include "base/error.h"
#include "shade/normalize_ref.h"
#include "shade/spherical_harmonics_ref.h"

namespace tilegrad {
namespace {

// The arrays of a scene that are packed. Scenes with the same ones share what is packed.
bool SameSources(const Scene& a, const Scene& b) {
  bool same = a.faces.data() == b.faces.data() && a.faces.size() == b.faces.size();
  if (!same || a.positions.data() != b.positions.data()) return false;  // most often
  ForEachStreamField<float>(
      a, b, [&](const char*, Varying, int, const auto& field, const auto& other) {
        const Stream x = AsStream<float>(field), y = AsStream<float>(other);
        same &= x.values.data() == y.values.data() && x.values.size() == y.values.size();
      });
  return same;
}

void SetLights(const Scene& scene, StageScene* out) {
  out->lights.assign(scene.lights.begin(), scene.lights.end());
  out->inverse_lengths.clear();
  for (auto& light : out->lights) {
    const auto unit = shade::NormalizeScaledRef(light.direction);
    light.direction = unit.unit;
    out->inverse_lengths.push_back(unit.inverse_length);
  }
  if (scene.shading.lighting != Lighting::kSphericalHarmonics) return;
  out->sh = shade::ShPolynomialOf<float>(scene.sh);
}

void SetSurfaces(const Scene& scene, StageScene* out) {
  out->surfaces.assign(scene.surfaces.begin(), scene.surfaces.end());
  if (!out->surfaces.empty()) return;
  Surface surface;
  surface.texture = scene.textures.empty() ? -1 : 0;
  out->surfaces.push_back(surface);
}

shade::Vec3<float> EyeOf(const Camera& camera) {  // -R^T t
  shade::Vec3<float> eye = {};
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c)
      eye[c] -= camera.rotation[3 * r + c] * camera.translation[r];
  }
  return eye;
}

bool SameTexture(const shade::TextureView& a, const shade::TextureView& b) {
  return a.texels.data() == b.texels.data() && a.width == b.width && a.height == b.height &&
         a.wrap == b.wrap && a.filter == b.filter;
}

}  // namespace

void ShadeInputs::PrepareTextures(std::span<const Scene> scenes) {
  pyramid_views_.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    for (const Texture& texture : scenes[n].textures) {
      const shade::TextureView view = shade::ViewOf(texture);
      std::size_t i = 0;
      while (i < pyramid_views_.size() && !SameTexture(pyramid_views_[i], view)) ++i;
      if (i == pyramid_views_.size()) pyramid_views_.push_back(view);
      if (i == pyramids_.size()) pyramids_.push_back(std::make_unique<shade::TexturePyramid>());
      stage_scenes_[n].textures.push_back(pyramids_[i].get());
    }
  }
  StageClock clock;
  workers_->For(pyramid_views_.size(),
                [&](std::size_t i, std::size_t) { pyramids_[i]->Build(pyramid_views_[i]); });
  clock.Lap(&work_.textures_ms);
  for (std::size_t i = 0; i < pyramid_views_.size(); ++i) {
    const shade::LevelSize& last = pyramids_[i]->sizes().back();
    work_.texels += static_cast<std::int64_t>(last.first + last.texels());
  }
}

void ShadeInputs::Begin(std::span<const Scene> scenes, bool textures) {
  work_ = {};
  stage_scenes_.resize(scenes.size());
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    StageScene& out = stage_scenes_[n];
    out.scene = &scenes[n];
    SetSurfaces(scenes[n], &out);
    SetLights(scenes[n], &out);
    out.eye = EyeOf(scenes[n].camera);
    out.textures.clear();
  }
  if (textures) PrepareTextures(scenes);
}

void ShadeInputs::FindPacks(std::span<const Scene> scenes) {
  first_of_pack_.clear();
  pack_of_scene_.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (n == 0 || !SameSources(scenes[n - 1], scenes[n])) first_of_pack_.push_back(n);
    pack_of_scene_.push_back(first_of_pack_.size() - 1);
  }
  if (packs_.size() < first_of_pack_.size()) packs_.resize(first_of_pack_.size());
}

void ShadeInputs::DerivePackNormals(std::span<const Scene> scenes) {
  StageClock clock;
  workers_->For(first_of_pack_.size(), [&](std::size_t i, std::size_t) {
    DeriveNormals(scenes[first_of_pack_[i]], &packs_[i].normals);
  });
  for (const std::size_t n : first_of_pack_) {
    work_.normals += static_cast<std::int64_t>(scenes[n].faces.size() / 3);
  }
  clock.Lap(&work_.normals_ms);
}

bool ShadeInputs::PackStreams(std::span<const Scene> scenes, const StreamSets& sets) {
  StageClock clock;
  std::atomic<bool> finite = true;
  workers_->For(first_of_pack_.size(), [&](std::size_t i, std::size_t) {
    ScenePack& pack = packs_[i];
    const Scene& scene = scenes[first_of_pack_[i]];
    PackVaryings(scene, sets.varyings, pack.normals, &pack.varyings);
    if (!AllFinite(pack.varyings)) finite = false;
    if (sets.recomputed == nullptr) return;
    PackVaryings(scene, *sets.recomputed, pack.normals, &pack.recomputed);
    if (!AllFinite(pack.recomputed)) finite = false;
  });
  for (std::size_t i = 0; i < first_of_pack_.size(); ++i) {
    work_.packed += static_cast<std::int64_t>(packs_[i].varyings.size());
    if (sets.recomputed == nullptr) continue;
    work_.packed += static_cast<std::int64_t>(packs_[i].recomputed.size());
  }
  clock.Lap(&work_.pack_ms);
  return finite;
}

Status ShadeInputs::Pack(std::span<const Scene> scenes, const StreamSets& sets) {
  FindPacks(scenes);
  if (sets.normals && scenes[0].shading.normals != Normals::kGiven) DerivePackNormals(scenes);
  if (!PackStreams(scenes, sets)) {
    return InvalidArgument("normals from positions overflow: the product of two edges is no float");
  }
  views_.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    const ScenePack& pack = packs_[pack_of_scene_[n]];
    const VaryingSet& set = sets.varyings;
    PipelineScene view{&scenes[n], {pack.varyings, set.channels(), set.rate}};
    view.recomputed = view.attributes;
    if (sets.recomputed != nullptr) {
      view.recomputed = {pack.recomputed, sets.recomputed->channels(), sets.recomputed->rate};
    }
    views_.push_back(view);
  }
  return {};
}

void ShadeInputs::UsePlain(std::span<const Scene> scenes, bool colors, bool user) {
  views_.clear();
  for (const Scene& s : scenes) {
    PipelineScene view{&s, {}};
    if (colors) view.attributes = {s.colors.values, 3, s.colors.rate};
    if (user) view.attributes = {s.attributes.values, s.channels, s.attributes.rate};
    views_.push_back(view);
  }
}

}  // namespace tilegrad
