// SPDX-License-Identifier: Apache-2.0
// Small things that the fast renderer and the reference have in common: from the records of
// renderer.h to those of raster, and sizes.
#pragma once

#include <cstddef>

#include "raster/attributes.h"
#include "raster/near_clip.h"
#include "render/pipeline/records.h"

namespace tilegrad {

template <class T>
raster::FaceSource<T> FaceSourceOf(const SceneT<T>& scene, const RenderOptions& options) {
  return {scene.positions, scene.faces, &scene.camera, options.culling == FaceCulling::kBack};
}
template <class T>
raster::FaceSource<T> FaceSourceOf(const PipelineSceneT<T>& scene, const RenderOptions& options) {
  return {scene.positions, scene.faces, &scene.camera, options.culling == FaceCulling::kBack};
}

template <class T>
raster::AttributeViewT<const T> AttributesOf(const PipelineSceneT<T>& scene) {
  return {scene.attributes, scene.channels, scene.rate};
}

template <class T>
void SizeFrame(int images, int channels, const RenderOptions& options, const Outputs& request,
               PipelineFrameT<T>* frame) {
  frame->images = images;
  frame->channels = request.attributes ? channels : 0;
  frame->height = options.height;
  frame->width = options.width;
  const std::size_t pixels = static_cast<std::size_t>(images) *
                             static_cast<std::size_t>(options.height) *
                             static_cast<std::size_t>(options.width);
  frame->face_ids.resize(pixels);
  frame->attributes.resize(pixels * static_cast<std::size_t>(frame->channels));
  frame->alpha.resize(request.alpha ? pixels : 0);
  frame->depth.resize(request.depth ? pixels : 0);
  frame->barycentrics.resize(request.barycentrics ? 2 * pixels : 0);
  frame->alpha_error_bound = 0;
}

}  // namespace tilegrad
