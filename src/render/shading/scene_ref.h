// SPDX-License-Identifier: Apache-2.0
// A scene made ready for the naive shaded renderer: its streams side by side at the corners of its
// faces, normals derived, lights with unit directions. Templates over T, as shaded_renderer_ref.h.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "render/pipeline/pipeline_ref.h"
#include "render/shading/direction_scale.h"
#include "render/shading/pixel_ref.h"
#include "render/shading/plan.h"
#include "shade/mesh_normals_ref.h"

namespace tilegrad {

// A scene ready for its pixels.
template <class T>
struct ShadedRefScene {
  const ShadedSceneT<T>* scene;
  VaryingSet set;                             // of `packed`, at corners
  std::vector<shade::UnitVector<T>> normals;  // derived: [V] or [F]
  std::vector<T> packed;                      // [F,3,C]
  SceneViewT<T> view;                         // of the packed attributes
  PreparedScene<T> prepared;
  std::vector<shade::PyramidRef<T>> pyramids;
  ShadeUniforms<T> uniforms;
  std::vector<T> inverse_lengths;  // of the lights' directions
};

// Rows of a stream that the corner `i` of the faces has: the scene's arrays, or their gradients.
template <class T>
std::size_t StreamRow(const ShadedSceneT<T>& scene, AttributeRate rate, std::size_t i) {
  return rate == AttributeRate::kCorner ? i : static_cast<std::size_t>(scene.faces[i]);
}

// Calls visit(varying, rate, stream [rows][width]) for the streams of a scene, given as the scene's
// arrays or as gradients of them. Normals that are derived are left out.
template <class T, class Streams, class Visit>
void ForEachRefStream(const ShadedSceneT<T>& scene, const Streams& streams, const Visit& visit) {
  visit(Varying::kColor, scene.colors.rate, streams.colors);
  visit(Varying::kUv, scene.uvs.rate, streams.uvs);
  visit(Varying::kPosition, AttributeRate::kVertex, streams.positions);
  visit(Varying::kLightDirection, AttributeRate::kVertex, streams.light_directions);
  visit(Varying::kUser, scene.rate, streams.attributes);
  if (scene.model.normals == NormalKind::kGiven) {
    visit(Varying::kNormal, scene.normals.rate, streams.normals);
  }
}

template <class T>
struct RefStreams {
  std::span<T> positions, colors, uvs, normals, light_directions, attributes;
};

template <class T>
RefStreams<const T> StreamsOf(const ShadedSceneT<T>& s) {
  return {s.positions,      s.colors.values,    s.uvs.values,
          s.normals.values, s.light_directions, s.attributes};
}

template <class T>
std::size_t RefNormalRow(const ShadedSceneT<T>& scene, std::size_t corner) {
  return scene.model.normals == NormalKind::kFlat ? corner / 3
                                                  : static_cast<std::size_t>(scene.faces[corner]);
}

template <class T>
void PackRef(ShadedRefScene<T>* s) {
  const ShadedSceneT<T>& scene = *s->scene;
  s->set.rate = AttributeRate::kCorner, s->set.user_channels = scene.channels;
  s->set.has = {!scene.colors.values.empty(),
                !scene.uvs.values.empty(),
                true,
                true,
                !scene.light_directions.empty(),
                true};
  const auto channels = static_cast<std::size_t>(s->set.channels());
  s->packed.assign(scene.faces.size() * channels, T(0));
  ForEachRefStream(scene, StreamsOf(scene), [&](Varying v, AttributeRate rate, auto stream) {
    const auto width = static_cast<std::size_t>(s->set.width(v));
    const T scale = T(StreamScale(scene, v));
    for (std::size_t i = 0; i < scene.faces.size(); ++i) {
      for (std::size_t c = 0; c < width && !stream.empty(); ++c) {
        s->packed[i * channels + static_cast<std::size_t>(s->set.first(v)) + c] =
            scale * stream[StreamRow(scene, rate, i) * width + c];
      }
    }
  });
  if (scene.model.normals == NormalKind::kGiven) return;
  const auto first = static_cast<std::size_t>(s->set.first(Varying::kNormal));
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    const auto& unit = s->normals[RefNormalRow(scene, i)].unit;
    std::copy(unit.begin(), unit.end(),
              s->packed.begin() + static_cast<std::ptrdiff_t>(i * channels + first));
  }
}

template <class T>
void SetUniformsRef(ShadedRefScene<T>* s) {
  const ShadedSceneT<T>& scene = *s->scene;
  ShadeUniforms<T>& u = s->uniforms;
  u.surfaces.assign(scene.surfaces.begin(), scene.surfaces.end());
  if (u.surfaces.empty()) u.surfaces.resize(1);
  if (scene.surfaces.empty()) u.surfaces[0].texture = scene.textures.empty() ? -1 : 0;
  for (const auto& light : scene.lights) {
    const auto unit = shade::NormalizeScaledRef(light.direction);
    u.lights.push_back({unit.unit, light.intensity});
    s->inverse_lengths.push_back(unit.inverse_length);
  }
  if (scene.model.lighting == Lighting::kSphericalHarmonics) {
    u.sh = shade::ShPolynomialOf<T>(scene.model.sh_basis, scene.sh);
  }
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      u.eye[c] -= scene.camera.rotation[3 * r + c] * scene.camera.translation[r];
    }
  }
  for (const auto& texture : scene.textures) s->pyramids.emplace_back(texture);
}

template <class T>
void PrepareShadedRef(const ShadedSceneT<T>& scene, const RenderOptions& options,
                      ShadedRefScene<T>* s) {
  s->scene = &scene;
  const shade::TriangleMeshT<T> mesh{scene.positions, scene.faces};
  if (scene.model.normals == NormalKind::kSmooth) {
    s->normals.resize(scene.positions.size() / 3);
    shade::SmoothNormalsRef<T>(mesh, s->normals);
  } else if (scene.model.normals == NormalKind::kFlat) {
    s->normals.resize(scene.faces.size() / 3);
    shade::FlatNormalsRef<T>(mesh, s->normals);
  }
  PackRef(s);
  SetUniformsRef(s);
  s->view = {scene.positions,        scene.faces, s->packed, s->set.channels(),
             AttributeRate::kCorner, scene.camera};
  PrepareRef(s->view, options, &s->prepared);
}

}  // namespace tilegrad
