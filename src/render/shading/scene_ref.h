// SPDX-License-Identifier: Apache-2.0
// A scene made ready for the naive renderer: its streams side by side at the corners of its
// faces, normals derived, lights with unit directions. Templates over T, as render/reference.h.
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
struct RefScene {
  const SceneT<T>* scene;
  VaryingSet set;                             // of `packed`, at corners
  std::vector<shade::UnitVector<T>> normals;  // derived: [V] or [F]
  std::vector<T> packed;                      // [F,3,C]
  PipelineSceneT<T> view;                     // of the packed attributes
  PreparedScene<T> prepared;
  std::vector<shade::PyramidRef<T>> pyramids;
  ShadeUniforms<T> uniforms;
  std::vector<T> inverse_lengths;  // of the lights' directions
};

// Rows of a stream that the corner `i` of the faces has: the scene's arrays, or their gradients.
template <class T>
std::size_t StreamRow(const SceneT<T>& scene, Rate rate, std::size_t i) {
  return rate == Rate::kCorner ? i : static_cast<std::size_t>(scene.faces[i]);
}

template <class T>
std::size_t RefNormalRow(const SceneT<T>& scene, std::size_t corner) {
  return scene.shading.normals == Normals::kFlat ? corner / 3
                                                 : static_cast<std::size_t>(scene.faces[corner]);
}

template <class T>
void PackRef(RefScene<T>* s) {
  const SceneT<T>& scene = *s->scene;
  s->set.rate = Rate::kCorner;
  s->set.user_channels = scene.channels;
  ForEachStream(scene, {}, [&](const SceneStream<T>& stream) {
    s->set[stream.what] = !stream.values.empty();
  });
  s->set[Varying::kNormal] = s->set[Varying::kPosition] = s->set[Varying::kUser] = true;
  const auto channels = static_cast<std::size_t>(s->set.channels());
  s->packed.assign(scene.faces.size() * channels, T(0));
  ForEachStream(scene, {}, [&](const SceneStream<T>& stream) {
    if (stream.what == Varying::kNormal && scene.shading.normals != Normals::kGiven) return;
    const auto width = static_cast<std::size_t>(s->set.width(stream.what));
    const T scale = T(StreamScale(scene, stream.what));
    for (std::size_t i = 0; i < scene.faces.size(); ++i) {
      for (std::size_t c = 0; c < width && !stream.values.empty(); ++c) {
        s->packed[i * channels + static_cast<std::size_t>(s->set.first(stream.what)) + c] =
            scale * stream.values[StreamRow(scene, stream.rate, i) * width + c];
      }
    }
  });
  if (scene.shading.normals == Normals::kGiven) return;
  const auto first = static_cast<std::size_t>(s->set.first(Varying::kNormal));
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    const auto& unit = s->normals[RefNormalRow(scene, i)].unit;
    std::copy(unit.begin(), unit.end(),
              s->packed.begin() + static_cast<std::ptrdiff_t>(i * channels + first));
  }
}

template <class T>
void SetUniformsRef(RefScene<T>* s) {
  const SceneT<T>& scene = *s->scene;
  ShadeUniforms<T>& u = s->uniforms;
  u.surfaces.assign(scene.surfaces.begin(), scene.surfaces.end());
  if (u.surfaces.empty()) u.surfaces.resize(1);
  if (scene.surfaces.empty()) u.surfaces[0].texture = scene.textures.empty() ? -1 : 0;
  for (const auto& light : scene.lights) {
    const auto unit = shade::NormalizeScaledRef(light.direction);
    u.lights.push_back({unit.unit, light.intensity});
    s->inverse_lengths.push_back(unit.inverse_length);
  }
  if (scene.shading.lighting == Lighting::kSphericalHarmonics) {
    u.sh = shade::ShPolynomialOf<T>(scene.sh);
  }
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      u.eye[c] -= scene.camera.rotation[3 * r + c] * scene.camera.translation[r];
    }
  }
  for (const auto& texture : scene.textures) s->pyramids.emplace_back(shade::ViewOf(texture));
}

template <class T>
void PrepareRefScene(const SceneT<T>& scene, const RenderOptions& options, RefScene<T>* s) {
  s->scene = &scene;
  const shade::TriangleMeshT<T> mesh{scene.positions, scene.faces};
  if (scene.shading.normals == Normals::kSmooth) {
    s->normals.resize(scene.positions.size() / 3);
    shade::SmoothNormalsRef<T>(mesh, s->normals);
  } else if (scene.shading.normals == Normals::kFlat) {
    s->normals.resize(scene.faces.size() / 3);
    shade::FlatNormalsRef<T>(mesh, s->normals);
  }
  PackRef(s);
  SetUniformsRef(s);
  s->view = {scene.positions,   scene.faces,   s->packed,
             s->set.channels(), Rate::kCorner, scene.camera};
  PrepareRef(s->view, options, &s->prepared);
}

}  // namespace tilegrad
