// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "raster/project.h"
#include "render/pipeline/image_scratch.h"
#include "render/pipeline/stages.h"

namespace tilegrad {
namespace {

// Converts `attributes` of the scene to the layout of the mesh; `storage` is for a clipped mesh.
raster::AttributeViewT<const float> InMeshLayout(const PipelineScene& scene,
                                                 const raster::ScreenMesh& mesh,
                                                 raster::AttributeViewT<const float> attributes,
                                                 AlignedVector<float>* storage) {
  if (!mesh.was_clipped()) return attributes;
  storage->resize(raster::AttributeRows(mesh, attributes.rate) *
                  static_cast<std::size_t>(attributes.channels));
  raster::ClipAttributes<float>(mesh, scene.mesh->faces, attributes, *storage);
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
  return std::memcmp(&a, &b, sizeof(Camera)) == 0;  // NOLINT(bugprone-suspicious-memory-comparison)
}

bool IsPrepared(const SceneToPrepare& in, const RenderOptions& options,
                const PrepareRequest& request, const PreparedFrom& from) {
  return from.valid && in.topology.id == from.topology &&
         (from.drawn_bins || !request.drawn_bins) && (from.alpha || request.alpha == nullptr) &&
         from.options == options && SameCamera(in.scene.mesh->camera, from.camera);
}

void RememberPrepared(const SceneToPrepare& in, const RenderOptions& options,
                      const PrepareRequest& request, PreparedFrom* from) {
  const Scene& scene = *in.scene.mesh;
  from->valid = true;
  from->drawn_bins = request.drawn_bins;
  from->alpha = request.alpha != nullptr;
  from->positions.assign(scene.positions.begin(), scene.positions.end());
  from->topology = in.topology.id;
  from->camera = scene.camera;
  from->options = options;
}

void PrepareMesh(const SceneToPrepare& in, const RenderOptions& options,
                 const PrepareRequest& request, const Workers& workers, ImageScratch* image) {
  raster::FaceSource<float> source = FaceSourceOf(*in.scene.mesh, options);
  source.corners = &in.topology.corners;
  const bool soft_tree = request.alpha != nullptr && request.alpha->needs().soft_tree;
  raster::Project(source, options.width, options.height, &image->buffers,
                  {request.drawn_bins ? &image->drawn_faces : nullptr,
                   soft_tree ? &image->soft.corners : nullptr},
                  &workers);
  image->mesh = image->buffers.View();
  if (request.drawn_bins) {
    image->drawn =
        raster::BinDrawnFaces(image->drawn_faces, raster::BinGrid(options.width, options.height),
                              &image->drawn_buffers, &workers);
  }
  if (soft_tree) raster::BuildSoftTree(&image->soft, &workers);
  if (request.alpha != nullptr) request.alpha->Prepare(in.n, *image);
}

std::size_t VerticesOf(const PipelineScene& scene) { return scene.mesh->positions.size() / 3; }

// Whether both use the same array: its numbers need no comparison.
bool ShareFaces(const PipelineScene& a, const PipelineScene& b) {
  return a.mesh->faces.data() == b.mesh->faces.data() &&
         a.mesh->faces.size() == b.mesh->faces.size() && VerticesOf(a) == VerticesOf(b);
}

bool HasFacesOf(const FaceTopology& topology, const PipelineScene& scene) {
  const std::span<const std::int32_t> faces = scene.mesh->faces;
  return topology.id.version != 0 && topology.vertices == VerticesOf(scene) &&
         topology.faces.size() == faces.size() &&
         (faces.empty() ||
          std::memcmp(topology.faces.data(), faces.data(), faces.size_bytes()) == 0);
}

}  // namespace

void PrepareImage(const SceneToPrepare& in, const RenderOptions& options,
                  const PrepareRequest& request, const Workers& workers, ImageScratch* image,
                  RenderStats* stats) {
  const PipelineScene& scene = in.scene;
  // Compares only if that may save work: positions change from frame to frame. By bits, not hashes,
  // so that reuse gives what recomputation would.
  const bool same_positions =
      request.reuse && SameBits(scene.mesh->positions, image->prepared.positions);
  if (!same_positions || !IsPrepared(in, options, request, image->prepared)) {
    ++stats->prepared;
    image->prepared.valid = false;
    PrepareMesh(in, options, request, workers, image);
    RememberPrepared(in, options, request, &image->prepared);
  }
  image->attributes =
      InMeshLayout(scene, image->mesh, scene.attributes, &image->clipped_attributes);
}

void PrepareRecomputed(const PipelineScene& scene, ImageScratch* image) {
  image->recomputed =
      InMeshLayout(scene, image->mesh, scene.recomputed, &image->clipped_recomputed);
}

// Compares only adjacent scenes, so that a batch of all different meshes costs no more.
void Topologies::Group(std::span<const PipelineScene> scenes) {
  of_scene_.resize(scenes.size());
  first_scene_.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (n == 0 || !ShareFaces(scenes[n - 1], scenes[n])) first_scene_.push_back(n);
    of_scene_[n] = first_scene_.size() - 1;
  }
  if (topologies_.size() < first_scene_.size()) topologies_.resize(first_scene_.size());
}

void Topologies::Update(std::span<const PipelineScene> scenes, const Workers& workers) {
  Group(scenes);
  ++updates_;
  workers.For(first_scene_.size(), [&](std::size_t i) {
    const PipelineScene& scene = scenes[first_scene_[i]];
    FaceTopology& topology = topologies_[i];
    if (HasFacesOf(topology, scene)) return;
    topology.id = {};
    topology.vertices = VerticesOf(scene);
    topology.faces.assign(scene.mesh->faces.begin(), scene.mesh->faces.end());
    raster::SplitFaces(topology.faces, &topology.corners, &workers);
    topology.id = {i, updates_};
  });
}

}  // namespace tilegrad
