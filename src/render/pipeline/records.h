// SPDX-License-Identifier: Apache-2.0
// What the pipeline takes and gives: a mesh with numbers to interpolate, and images. Attributes are
// whatever the renderer has laid side by side (render/shading/pack.h).
#pragma once

#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "scene/camera.h"
#include "tilegrad/options.h"
#include "tilegrad/scene.h"

namespace tilegrad {

// Views over arrays that are kept alive and unchanged until Backward.
template <class T>
struct PipelineSceneT {
  std::span<const T> positions;         // [V,3] world
  std::span<const std::int32_t> faces;  // [F,3] indices in [0, V)
  std::span<const T> attributes;        // [V,C] or [F,3,C] by `rate`; empty if channels == 0
  int channels = 0;                     // C >= 0
  Rate rate = Rate::kVertex;
  CameraT<T> camera;
};

// A scene with its user's channels as attributes.
template <class T>
PipelineSceneT<T> PipelineSceneOf(const SceneT<T>& s) {
  return {s.positions, s.faces, s.attributes.values, s.channels, s.attributes.rate, s.camera};
}

// The images of a batch, planar: N images, row 0 on top. Reused between calls of one size without
// allocation.
template <class T>
struct PipelineFrameT {
  int images = 0, channels = 0, height = 0, width = 0;
  // [N,H,W] index into the scene's faces, -1 at background pixels; always there
  AlignedVector<std::int32_t> face_ids;
  AlignedVector<T> attributes;  // [N,C,H,W]; 0 at background pixels
  AlignedVector<T> alpha;       // [N,H,W]; exactly 1 at foreground pixels
  AlignedVector<T> depth;       // [N,H,W]; +infinity at background pixels
  // [N,2,H,W] weights of corners 1 and 2 (corner 0 has the rest); 0 at background pixels
  AlignedVector<T> barycentrics;
  // [N, H W] 1 - alpha with more digits, where Backward has use for it, in the order of
  // raster/soft_mask/soft_mask.h, SoftMaskImages; the rest is unspecified. May be emptied: Backward
  // then takes more time.
  AlignedVector<T> transmittance;
  double alpha_error_bound = 0;  // as ImagesT
  // [N,H,W], or empty. Before Render: a pixel shows the nearest face whose 1/depth is less than
  // this (raster/visibility.h: PeelVisibility). After it: 1/depth of that face, 0 where there is
  // none. Only the engine's forward pass knows it.
  AlignedVector<T> peeled;
};

// dL/d(image); an empty span is zero. Shapes as in the frame.
template <class T>
struct PipelineCotangentsT {
  std::span<const T> attributes;
  std::span<const T> alpha;
};

// dL/d(scene), overwritten. An empty span (or false) is not computed.
template <class T>
struct PipelineGradientsT {
  std::span<T> positions;   // [V,3]
  std::span<T> attributes;  // as in the scene
  bool camera = false;      // fill d_camera
  CameraT<T> d_camera;      // as SceneGradientsT::camera
};

using PipelineScene = PipelineSceneT<float>;
using PipelineFrame = PipelineFrameT<float>;
using PipelineCotangents = PipelineCotangentsT<float>;
using PipelineGradients = PipelineGradientsT<float>;

}  // namespace tilegrad
