// SPDX-License-Identifier: Apache-2.0
#include "render/prepare.h"

#include <algorithm>
#include <cstring>

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

template <class T>
bool SameBits(std::span<const T> a, const AlignedVector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

bool SameCamera(const Camera& a, const Camera& b) {
  static_assert(sizeof(Camera) == 17 * sizeof(float));  // no padding
  return std::memcmp(&a, &b, sizeof(Camera)) == 0;
}

// Bits, not hashes: what was kept is what would be computed again.
bool IsPrepared(const SceneView& scene, const RenderOptions& options, const PrepareRequest& request,
                const PreparedFrom& from) {
  return request.reuse && from.valid && (from.drawn_bins || !request.drawn_bins) &&
         (from.soft_bins || !request.soft_bins) && from.width == options.width &&
         from.height == options.height && from.delta == options.delta &&
         from.max_alpha_error == options.max_alpha_error && from.culling == options.culling &&
         SameCamera(scene.camera, from.camera) && SameBits(scene.positions, from.positions) &&
         SameBits(scene.faces, from.faces);
}

void RememberPrepared(const SceneView& scene, const RenderOptions& options,
                      const PrepareRequest& request, PreparedFrom* from) {
  from->valid = true, from->drawn_bins = request.drawn_bins, from->soft_bins = request.soft_bins;
  from->positions.assign(scene.positions.begin(), scene.positions.end());
  from->faces.assign(scene.faces.begin(), scene.faces.end());
  from->camera = scene.camera;
  from->width = options.width, from->height = options.height;
  from->delta = options.delta, from->max_alpha_error = options.max_alpha_error;
  from->culling = options.culling;
}

void PrepareMesh(const SceneView& scene, const RenderOptions& options,
                 const PrepareRequest& request, ImageScratch* image) {
  raster::Project(FaceSourceOf(scene, options), options.width, options.height, &image->buffers,
                  request.drawn_bins ? &image->drawn_faces : nullptr);
  image->mesh = image->buffers.View();
  const raster::TileGrid grid(options.width, options.height);
  if (request.drawn_bins) {
    image->drawn = raster::BinDrawnFaces(image->drawn_faces.faces(),
                                         raster::BinGrid(options.width, options.height),
                                         &image->drawn_buffers);
  }
  if (request.soft_bins) {
    image->soft_plan =
        raster::PlanSoftMask({options.width, options.height, options.delta, options.max_alpha_error,
                              raster::CountSoftFaces(image->mesh)});
    image->soft = raster::BinSoftFaces(image->mesh, grid, image->soft_plan.margin_x,
                                       image->soft_plan.margin_y, &image->soft_buffers);
  }
}

}  // namespace

void PrepareImage(const SceneView& scene, const RenderOptions& options,
                  const PrepareRequest& request, ImageScratch* image) {
  if (!IsPrepared(scene, options, request, image->prepared)) {
    image->prepared.valid = false;
    PrepareMesh(scene, options, request, image);
    RememberPrepared(scene, options, request, &image->prepared);
  }
  PrepareAttributes(scene, image);
}

}  // namespace tilegrad
