// SPDX-License-Identifier: Apache-2.0
// What the pipeline takes and gives: scenes with what is interpolated over their faces, which the
// renderer has laid side by side (render/shading/pack.h), and images (render/frame_images.h).
#pragma once

#include <span>

#include "raster/attributes.h"
#include "raster/near_clip.h"
#include "scene/camera.h"
#include "tilegrad/options.h"
#include "tilegrad/scene.h"

namespace tilegrad {

// A scene of a batch as it is drawn: checked, and kept alive and unchanged until the call ends.
struct PipelineScene {
  const Scene* mesh;  // positions, faces and camera
  // In the layout of the scene: what is interpolated, and on the way back gets a gradient;
  raster::AttributeViewT<const float> attributes;
  // and what a PixelStage needs again on the way back.
  raster::AttributeViewT<const float> recomputed = {};
};

// dL/d(what is interpolated), an image of as many channels as it has, and dL/d(alpha); empty: zero.
struct PipelineCotangents {
  std::span<const float> attributes;
  std::span<const float> alpha;
};

// dL/d(scene), overwritten. An empty span (or false) is not computed.
struct PipelineGradients {
  std::span<float> positions;   // [V,3]
  std::span<float> attributes;  // as in the scene
  bool camera = false;          // fill d_camera
  Camera d_camera;              // as SceneGradientsT::camera
};

template <class T>
raster::FaceSource<T> FaceSourceOf(const SceneT<T>& scene, const RenderOptions& options) {
  return {scene.positions, scene.faces, &scene.camera, options.culling == FaceCulling::kBack};
}

}  // namespace tilegrad
