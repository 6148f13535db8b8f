// SPDX-License-Identifier: Apache-2.0
#include "render/prepare.h"

#include <algorithm>
#include <cstring>

#include "raster/project.h"
#include "render/frame_layout.h"
#include "render/quick_checks.h"

namespace tilegrad {
namespace {

// `attributes` of the scene, in the layout of the mesh; `storage` is for a mesh that was cut.
raster::AttributeViewT<const float> InMeshLayout(const SceneView& scene,
                                                 const raster::ScreenMesh& mesh,
                                                 raster::AttributeViewT<const float> attributes,
                                                 AlignedVector<float>* storage) {
  if (!mesh.was_clipped()) return attributes;
  storage->resize(raster::AttributeRows(mesh, attributes.rate) *
                  static_cast<std::size_t>(attributes.channels));
  raster::ClipAttributes<float>(mesh, scene.faces, attributes, *storage);
  attributes.values = *storage;
  return attributes;
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

// Which arrays of a scene are, bit by bit, those that were prepared. Bits, not hashes: what was
// kept is what would be computed again.
struct Unchanged {
  bool positions, faces;
};

// Positions are compared only if that may save something: they change from frame to frame.
Unchanged CompareScene(const SceneView& scene, const PrepareRequest& request,
                       const PreparedFrom& from) {
  return {request.reuse && SameBits(scene.positions, from.positions),
          scene.positions.size() == from.positions.size() && SameBits(scene.faces, from.faces)};
}

bool IsSoundScene(const SceneView& scene, const Unchanged& unchanged) {
  const auto vertices = static_cast<std::int32_t>(scene.positions.size() / 3);
  return (unchanged.faces || AllWithin(scene.faces, 0, vertices)) &&
         (unchanged.positions || AllFinite(scene.positions)) && AllFinite(scene.attributes) &&
         IsSoundCamera(scene.camera);
}

bool IsPrepared(const SceneView& scene, const RenderOptions& options, const PrepareRequest& request,
                const Unchanged& unchanged, const PreparedFrom& from) {
  return request.reuse && from.valid && unchanged.positions && unchanged.faces &&
         (from.drawn_bins || !request.drawn_bins) && (from.soft_tree || !request.soft_tree) &&
         from.width == options.width && from.height == options.height &&
         from.delta == options.delta && from.max_alpha_error == options.max_alpha_error &&
         from.culling == options.culling && SameCamera(scene.camera, from.camera);
}

void RememberPrepared(const SceneView& scene, const RenderOptions& options,
                      const PrepareRequest& request, const Unchanged& unchanged,
                      PreparedFrom* from) {
  from->valid = true, from->drawn_bins = request.drawn_bins, from->soft_tree = request.soft_tree;
  if (!unchanged.positions) from->positions.assign(scene.positions.begin(), scene.positions.end());
  if (!unchanged.faces) from->faces.assign(scene.faces.begin(), scene.faces.end());
  from->camera = scene.camera;
  from->width = options.width, from->height = options.height;
  from->delta = options.delta, from->max_alpha_error = options.max_alpha_error;
  from->culling = options.culling;
}

void PrepareMesh(const SceneView& scene, const RenderOptions& options,
                 const PrepareRequest& request, const Workers& workers, ImageScratch* image) {
  raster::Project(FaceSourceOf(scene, options), options.width, options.height, &image->buffers,
                  request.drawn_bins ? &image->drawn_faces : nullptr, &workers);
  image->mesh = image->buffers.View();
  if (request.drawn_bins) {
    image->drawn =
        raster::BinDrawnFaces(image->drawn_faces, raster::BinGrid(options.width, options.height),
                              &image->drawn_buffers, &workers);
  }
  if (request.soft_tree) {
    raster::BuildSoftTree(image->mesh, &image->soft, &workers);
    image->soft_plan = raster::PlanSoftMask(
        {options.width, options.height, options.delta, options.max_alpha_error, image->soft.faces});
  }
}

}  // namespace

bool PrepareImage(const SceneView& scene, const RenderOptions& options,
                  const PrepareRequest& request, const Workers& workers, ImageScratch* image,
                  RenderStats* stats) {
  const Unchanged unchanged = CompareScene(scene, request, image->prepared);
  if (!IsSoundScene(scene, unchanged)) return false;
  if (!IsPrepared(scene, options, request, unchanged, image->prepared)) {
    ++stats->prepared;
    image->prepared.valid = false;
    PrepareMesh(scene, options, request, workers, image);
    RememberPrepared(scene, options, request, unchanged, &image->prepared);
  }
  image->attributes =
      InMeshLayout(scene, image->mesh, AttributesOf(scene), &image->clipped_attributes);
  return true;
}

void PrepareRecomputed(const PixelStage* stage, const SceneView& scene, std::size_t n,
                       ImageScratch* image) {
  if (stage == nullptr) return;
  image->recomputed =
      InMeshLayout(scene, image->mesh, stage->recomputed(n), &image->clipped_recomputed);
}

}  // namespace tilegrad
