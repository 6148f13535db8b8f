// SPDX-License-Identifier: Apache-2.0
#include "render/shading/inputs.h"

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "base/array_checks.h"
#include "base/clocks.h"
#include "base/error.h"
#include "render/shading/run.h"
#include "shade/normalize_ref.h"
#include "shade/spherical_harmonics_ref.h"

namespace tilegrad {
namespace {

// Whether the packed arrays of two scenes are the same; then they share the packed data.
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

enum class Rows { kVertex, kCorner, kFace };

Rows RowsOf(Rate rate) { return rate == Rate::kVertex ? Rows::kVertex : Rows::kCorner; }

Rows RowsOfStream(const Scene& scene, const SceneStream<float>& stream) {
  if (stream.what != Varying::kNormal || scene.shading.normals == Normals::kGiven) {
    return RowsOf(stream.rate);
  }
  return scene.shading.normals == Normals::kFlat ? Rows::kFace : Rows::kVertex;
}

// Numbers to interpolate, their stride, and the index of their rows.
struct Source {
  const float* values;
  std::size_t stride;
  Rows rows;
};

Source SourceOf(const Scene& scene, const SceneNormals& normals, Varying what) {
  const SceneStream<float> stream = StreamOf(scene, what);
  const Rows rows = RowsOfStream(scene, stream);
  if (what != Varying::kNormal || scene.shading.normals == Normals::kGiven) {
    return {stream.values.data(), static_cast<std::size_t>(stream.width), rows};
  }
  return {normals.empty() ? nullptr : normals[0].unit.data(),
          sizeof(shade::UnitVector<float>) / sizeof(float), rows};
}

std::size_t PackedRows(const Scene& scene, const VaryingSet& set) {
  return set.rate == Rate::kVertex ? scene.positions.size() / 3 : scene.faces.size();
}

// Calls visit(row of the packed array, row of the stream).
template <class Visit>
void ForEachRow(const Scene& scene, Rate packed, Rows rows, const Visit& visit) {
  if (packed == Rate::kVertex) {
    for (std::size_t v = 0; v < scene.positions.size() / 3; ++v) visit(v, v);
    return;
  }
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    visit(i, rows == Rows::kVertex   ? static_cast<std::size_t>(scene.faces[i])
             : rows == Rows::kCorner ? i
                                     : i / 3);
  }
}

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

// From unit directions to the caller's directions.
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
                [&](std::size_t i) { pyramids_[i]->Build(pyramid_views_[i]); });
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
  workers_->For(first_of_pack_.size(), [&](std::size_t i) {
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
  workers_->For(first_of_pack_.size(), [&](std::size_t i) {
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

void DeriveNormals(const Scene& scene, SceneNormals* normals) {
  const shade::TriangleMesh mesh{scene.positions, scene.faces};
  if (scene.shading.normals == Normals::kSmooth) shade::SmoothNormals(mesh, normals);
  if (scene.shading.normals == Normals::kFlat) shade::FlatNormals(mesh, normals);
}

void PackVaryings(const Scene& scene, const VaryingSet& set, const SceneNormals& normals,
                  AlignedVector<float>* out) {
  const auto channels = static_cast<std::size_t>(set.channels());
  out->resize(PackedRows(scene, set) * channels);
  if (out->empty()) return;
  for (std::size_t i = 0; i < kVaryings; ++i) {
    const auto what = static_cast<Varying>(i);
    if (!set[what]) continue;
    const Source source = SourceOf(scene, normals, what);
    const auto width = static_cast<std::size_t>(set.width(what));
    const float scale = StreamScale(scene, what);
    float* const to = out->data() + set.first(what);
    ForEachRow(scene, set.rate, source.rows, [&](std::size_t row, std::size_t from) {
      for (std::size_t c = 0; c < width; ++c) {
        to[row * channels + c] = scale * source.values[from * source.stride + c];
      }
    });
  }
}

void AddStream(const Scene& scene, const VaryingSet& set, Varying what,
               std::span<const float> packed, std::span<float> stream) {
  if (packed.empty()) return;
  const auto channels = static_cast<std::size_t>(set.channels());
  const auto width = static_cast<std::size_t>(set.width(what));
  const float scale = StreamScale(scene, what);
  const float* const from = packed.data() + set.first(what);
  const Rows rows = RowsOfStream(scene, StreamOf(scene, what));
  ForEachRow(scene, set.rate, rows, [&](std::size_t row, std::size_t to) {
    for (std::size_t c = 0; c < width; ++c) {
      stream[to * width + c] += scale * from[row * channels + c];
    }
  });
}

void AddNormalsAdjoint(const Scene& scene, const SceneNormals& normals,
                       std::span<shade::Vec3<float>> d_units, std::span<float> d_positions) {
  const shade::TriangleMesh mesh{scene.positions, scene.faces};
  if (scene.shading.normals == Normals::kSmooth) {
    shade::SmoothNormalsAdjoint(mesh, normals, d_units, d_positions);
  } else if (scene.shading.normals == Normals::kFlat) {
    shade::FlatNormalsAdjoint(mesh, normals, d_units, d_positions);
  }
}

std::span<PipelineGradients> GradientMerge::Begin(const BackwardPlan& plan,
                                                  std::span<const PipelineScene> views,
                                                  const Targets& targets) {
  d_views_.clear();
  if (scratch_.size() < views.size()) scratch_.resize(views.size());
  const bool attributes = plan.pulled.channels() > 0;
  for (std::size_t n = 0; n < views.size(); ++n) {
    SceneScratch& s = scratch_[n];
    const SceneGradients& wanted = targets.scenes()[n];
    s.d_positions.resize(wanted.positions.size());
    s.d_varyings.resize(attributes ? views[n].attributes.values.size() : 0);
    d_views_.push_back({s.d_positions, s.d_varyings, wanted.camera != nullptr, {}});
  }
  return d_views_;
}

void GradientMerge::Run(const Batch& batch) {
  const std::size_t count = d_views_.size();
  for (std::size_t n = 0; n < count; ++n) {
    const SceneGradients& d = batch.targets.scenes()[n];
    if (d.camera != nullptr) *d.camera = d_views_[n].d_camera;
  }
  if (batch.plan.staged()) {
    workers_->For(count, [&](std::size_t n) { AddToPositions(batch, n); });
  }
  const auto arrays = batch.targets.arrays();
  workers_->For(arrays.size(), [&](std::size_t i) { FillArray(batch, arrays[i]); });
  if (batch.stage == nullptr) return;
  MergeUniforms(batch);
  if (batch.plan.to_texture) MergeTextures(batch);
}

// Gradients of interpolated positions, and of normals derived from positions.
void GradientMerge::AddToPositions(const Batch& batch, std::size_t n) {
  SceneScratch& s = scratch_[n];
  if (s.d_positions.empty()) return;
  const Scene& scene = *batch.inputs.scenes()[n].scene;
  const VaryingSet& set = batch.plan.pulled;
  if (set[Varying::kPosition]) {
    AddStream(scene, set, Varying::kPosition, s.d_varyings, s.d_positions);
  }
  if (!set[Varying::kNormal] || scene.shading.normals == Normals::kGiven) return;
  const SceneNormals& normals = batch.inputs.normals(n);
  if (normals.empty()) return;  // of no faces
  s.d_units.assign(normals.size(), {0, 0, 0});
  AddStream(scene, set, Varying::kNormal, s.d_varyings,
            {s.d_units[0].data(), 3 * s.d_units.size()});
  AddNormalsAdjoint(scene, normals, s.d_units, s.d_positions);
}

// For a stream; sets other arrays, to which this adds nothing, to 0 unless that happens later.
void GradientMerge::FillArray(const Batch& batch, std::span<const Targets::Target> array) const {
  const Targets::Target& first = array.front();
  const BackwardPlan& plan = batch.plan;
  if (first.texture && batch.stage != nullptr && plan.to_texture) return;
  const std::span<float> out = first.out;
  std::fill(out.begin(), out.end(), 0.0f);
  const bool position = first.stream == Varying::kPosition;
  // Normals derived from positions get the gradient; normals given in the scene are unused.
  const bool unused =
      first.stream == Varying::kNormal && plan.parts.shading.normals != Normals::kGiven;
  if (!first.stream || unused || (!position && !plan.pulled[*first.stream])) return;
  for (const Targets::Target& target : array) {
    const SceneScratch& s = scratch_[target.scene];
    if (position) {
      for (std::size_t i = 0; i < out.size(); ++i) out[i] += s.d_positions[i];
    } else {
      AddStream(*batch.inputs.scenes()[target.scene].scene, plan.pulled, *first.stream,
                s.d_varyings, out);
    }
  }
}

// Lights, coefficients, surfaces and, besides the part from geometry, cameras.
void GradientMerge::MergeUniforms(const Batch& batch) {
  const std::span<const StageScene> scenes = batch.inputs.scenes();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    sums_.Clear(scenes[n].surfaces.size(), scenes[n].lights.size());
    for (const StageBand& band : batch.stage->bands(n)) AddBand(band.sums, sums_);
    const SceneGradients& d = batch.targets.scenes()[n];
    AddSurfaces(scenes[n], sums_, d.surfaces);
    AddLights(scenes[n], sums_, d.lights);
    AddSh(scenes[n], sums_, d.sh);
    if (d.camera != nullptr) AddCamera(scenes[n], sums_, d.camera);
  }
}

void GradientMerge::FindTextures(const Batch& batch) {
  textures_.clear();
  for (const auto& array : batch.targets.arrays()) {
    if (!array.front().texture) continue;
    const shade::TexturePyramid* most = nullptr;  // the one with mip levels, if any
    for (const Targets::Target& target : array) {
      const auto* pyramid = batch.inputs.scenes()[target.scene].textures[*target.texture];
      if (most == nullptr || pyramid->sizes().size() > most->sizes().size()) most = pyramid;
    }
    textures_.push_back({array, most});
  }
  while (texture_gradients_.size() < textures_.size()) {
    texture_gradients_.push_back(std::make_unique<shade::TextureGradient>());
  }
}

// Sums each texel in the order of scenes, bands and pixels, whatever the number of parts.
void GradientMerge::MergeTextures(const Batch& batch) {
  FindTextures(batch);
  workers_->For(textures_.size(),
                [&](std::size_t i) { texture_gradients_[i]->Clear(*textures_[i].pyramid); });
  const std::size_t parts = textures_.size() >= workers_->size() ? 1 : 4;
  workers_->For(textures_.size() * parts, [&](std::size_t task) {
    const shade::RowShare rows{static_cast<int>(task % parts), static_cast<int>(parts)};
    for (const Targets::Target& target : textures_[task / parts].array) {
      for (const StageBand& band : batch.stage->bands(target.scene)) {
        texture_gradients_[task / parts]->Scatter(band.shares[*target.texture], rows);
      }
    }
  });
  workers_->For(textures_.size(), [&](std::size_t i) {
    texture_gradients_[i]->Finish(textures_[i].array.front().out);
  });
}

}  // namespace tilegrad
