// SPDX-License-Identifier: Apache-2.0
// From the records of include/tilegrad to those of the engine. Arrays are not copied.
#pragma once

#include <span>
#include <vector>

#include "render/scene.h"
#include "tilegrad/renderer.h"

namespace tilegrad::v0 {

namespace engine = ::tilegrad;

// The small records of a scene that the engine has in its own form.
template <class T>
struct SceneRecords {
  std::vector<engine::shade::TextureViewT<T>> textures;
  std::vector<engine::SurfaceT<T>> surfaces;
  std::vector<engine::shade::DirectionalLightT<T>> lights;
};

template <class T>
engine::CameraT<T> ToEngine(const CameraT<T>& camera);

// The result looks at `records`, which are overwritten.
template <class T>
engine::ShadedSceneT<T> ToEngine(const SceneT<T>& scene, SceneRecords<T>* records);

engine::RenderOptions ToEngine(const RenderOptions& options);
engine::ShadedRequest ToEngine(const Outputs& outputs);

template <class T>
engine::ShadedFrameGradientsT<T> ToEngine(const FrameGradientsT<T>& d_frame);

// Views of what is in `frame`.
template <class T>
ImagesT<T> ImagesOf(const engine::ShadedFrameT<T>& frame);

// Gradients of what is not a plain array go through records of the engine.
template <class T>
struct GradientRecords {
  std::vector<engine::SurfaceT<T>> surfaces;
  std::vector<engine::shade::DirectionalLightT<T>> lights;
};

// The result looks at `records`, which are sized to what is wanted, and at the arrays of `d`.
template <class T>
engine::ShadedGradientsT<T> ToEngine(const SceneGradientsT<T>& d, GradientRecords<T>* records);

// The gradients that are not plain arrays: to zero, and the engine's added.
template <class T>
void ClearRecords(const SceneGradientsT<T>& d);
template <class T>
void AddRecords(const engine::ShadedGradientsT<T>& from, const SceneGradientsT<T>& d);

}  // namespace tilegrad::v0
