// SPDX-License-Identifier: Apache-2.0
// Gradients of what is not a plain array, cameras, surfaces and lights, which scenes of a batch may
// share as well: each scene gets records of its own, which are added up in the order of scenes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "render/scene_fields.h"

namespace tilegrad {

template <class T>
class GradientRecords {
 public:
  // What the caller wants, with records of its own in place of the caller's.
  SceneGradientsT<T> Begin(const SceneGradientsT<T>& wanted) {
    SceneGradientsT<T> own = wanted;
    surfaces_.resize(wanted.surfaces.size());
    lights_.resize(wanted.lights.size());
    own.surfaces = surfaces_;
    own.lights = lights_;
    own.camera = wanted.camera == nullptr ? nullptr : &camera_;
    return own;
  }

  static void Clear(const SceneGradientsT<T>& d) {
    ForEachRecordPart(d, [](const char*, const char*, std::span<T> part) {
      std::fill(part.begin(), part.end(), T(0));
    });
    if (d.camera != nullptr) d.camera->near_plane = T(0);
  }

  void AddTo(const SceneGradientsT<T>& d) const {
    const auto add = [](const char*, std::span<const T> from, std::span<T> to) {
      for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
    };
    if (d.camera != nullptr) ForEachCameraPart(add, camera_, *d.camera);
    for (std::size_t i = 0; i < d.lights.size(); ++i)
      ForEachLightPart(add, lights_[i], d.lights[i]);
    for (std::size_t i = 0; i < d.surfaces.size(); ++i) {
      ForEachSurfacePart(add, surfaces_[i], d.surfaces[i]);
    }
  }

 private:
  CameraT<T> camera_;
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<LightT<T>> lights_;
};

}  // namespace tilegrad
