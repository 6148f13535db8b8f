// SPDX-License-Identifier: Apache-2.0
// The faces of a batch's meshes. Scenes that share their array of faces, as those of a template
// mesh do, share what follows from it: it then stays in the cache from image to image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "raster/screen_mesh.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// Tells whether an image still has the faces that it was prepared from.
struct TopologyId {
  std::size_t index = 0;
  std::uint64_t version = 0;  // 0: no faces
  bool operator==(const TopologyId&) const = default;
};

struct Topology {
  TopologyId id;
  std::size_t vertices = 0;
  AlignedVector<std::int32_t> faces;  // [F,3] as given, all in [0, vertices)
  raster::FaceCorners corners;        // of `faces`
};

// Grows to its largest use and stays.
class Topologies {
 public:
  // Makes the topologies of a batch, if they are not those of the last one.
  void Update(std::span<const PipelineScene> scenes, const Workers& workers);

  // That of scene n. Images may look at its corners as long as it has the same id.
  const Topology& of(std::size_t n) const { return topologies_[of_scene_[n]]; }

 private:
  void Group(std::span<const PipelineScene> scenes);

  std::deque<Topology> topologies_;       // stay where they are as more come
  std::vector<std::size_t> of_scene_;     // which of them
  std::vector<std::size_t> first_scene_;  // that has it
  std::uint64_t updates_ = 0;
};

}  // namespace tilegrad
