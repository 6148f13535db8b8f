// SPDX-License-Identifier: Apache-2.0
#include "render/pipeline/topologies.h"

#include <cstring>

#include "raster/project.h"

namespace tilegrad {
namespace {

std::size_t VerticesOf(const PipelineScene& scene) { return scene.mesh->positions.size() / 3; }

// The very same array: its numbers need no check.
bool ShareFaces(const PipelineScene& a, const PipelineScene& b) {
  return a.mesh->faces.data() == b.mesh->faces.data() &&
         a.mesh->faces.size() == b.mesh->faces.size() && VerticesOf(a) == VerticesOf(b);
}

bool HasFacesOf(const Topology& topology, const PipelineScene& scene) {
  const std::span<const std::int32_t> faces = scene.mesh->faces;
  return topology.id.version != 0 && topology.vertices == VerticesOf(scene) &&
         topology.faces.size() == faces.size() &&
         (faces.empty() ||
          std::memcmp(topology.faces.data(), faces.data(), faces.size_bytes()) == 0);
}

}  // namespace

// Only neighbours are compared, so that a batch of all different meshes costs no more.
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
  workers.For(first_scene_.size(), [&](std::size_t i, std::size_t) {
    const PipelineScene& scene = scenes[first_scene_[i]];
    Topology& topology = topologies_[i];
    if (HasFacesOf(topology, scene)) return;
    topology.id = {};
    topology.vertices = VerticesOf(scene);
    topology.faces.assign(scene.mesh->faces.begin(), scene.mesh->faces.end());
    raster::SplitFaces(topology.faces, &topology.corners, &workers);
    topology.id = {i, updates_};
  });
}

}  // namespace tilegrad
