// SPDX-License-Identifier: Apache-2.0
#include "render/prepare.h"

#include <algorithm>

#include "raster/project.h"
#include "render/frame_layout.h"

namespace tilegrad {
namespace {

void PrepareAttributes(const SceneView& scene, ImageScratch* image) {
  image->attributes = AttributesOf(scene);
  if (!image->mesh.was_clipped()) return;
  image->clipped_attributes.resize(raster::AttributeRows(image->mesh, scene.rate) *
                                   static_cast<std::size_t>(scene.channels));
  raster::ClipAttributes<float>(image->mesh, scene.faces, image->attributes,
                                image->clipped_attributes);
  image->attributes.values = image->clipped_attributes;
}

}  // namespace

void PrepareImage(const SceneView& scene, const RenderOptions& options,
                  const PrepareRequest& request, ImageScratch* image) {
  raster::Project(FaceSourceOf(scene, options), options.width, options.height, &image->buffers);
  image->mesh = image->buffers.View();
  PrepareAttributes(scene, image);
  const raster::TileGrid grid(options.width, options.height);
  if (request.drawn_bins) {
    image->drawn = raster::BinDrawnFaces(image->mesh, grid, &image->drawn_buffers);
  }
  if (request.soft_bins) {
    image->soft_plan =
        raster::PlanSoftMask({options.width, options.height, options.delta, options.max_alpha_error,
                              raster::CountSoftFaces(image->mesh)});
    image->soft = raster::BinSoftFaces(image->mesh, grid, image->soft_plan.margin_x,
                                       image->soft_plan.margin_y, &image->soft_buffers);
  }
}

void ClearImageGradients(const SceneView& scene, const SceneGradients& wanted,
                         ImageScratch* image) {
  const std::size_t vertices = image->mesh.vertices();
  for (auto* array : {&image->d_x, &image->d_y, &image->d_inverse_depth}) {
    array->assign(vertices, 0.0f);
  }
  image->d_clip_t.assign(image->mesh.clipped.size(), 0.0f);
  std::fill(wanted.attributes.begin(), wanted.attributes.end(), 0.0f);
  if (!image->mesh.was_clipped()) return;
  image->d_attributes.assign(
      raster::AttributeRows(image->mesh, scene.rate) * static_cast<std::size_t>(scene.channels),
      0.0f);
}

void FinishImageGradients(const SceneView& scene, const RenderOptions& options, ImageScratch* image,
                          SceneGradients* d_scene) {
  if (image->mesh.was_clipped()) {
    raster::ClipAttributesBackward<float>(image->mesh, scene.faces, AttributesOf(scene),
                                          image->d_attributes, d_scene->attributes,
                                          image->d_clip_t);
  }
  if (d_scene->positions.empty() && !d_scene->camera) return;
  const raster::ScreenGradients d_mesh{image->d_x, image->d_y, image->d_inverse_depth,
                                       image->d_clip_t};
  raster::ProjectBackward(FaceSourceOf(scene, options), image->mesh, d_mesh, &image->points,
                          {d_scene->positions, d_scene->camera ? &d_scene->d_camera : nullptr});
}

}  // namespace tilegrad
