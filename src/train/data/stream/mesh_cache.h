// SPDX-License-Identifier: Apache-2.0
// Textured meshes, as many in memory as fit into a number of bytes. Results depend on the index
// alone.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "render/picture/mesh_scene.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// A mesh as the dataset shows it, with small textures, ready to be rendered: two-sided, opaque, in
// the numbers of the files.
class TexturedMesh {
 public:
  explicit TexturedMesh(Mesh mesh, NormalSource normals = NormalSource::kFlat);
  const Mesh& mesh() const { return *mesh_; }
  const Scene& scene() const { return scene_->scene(); }
  std::size_t bytes() const;

 private:
  std::unique_ptr<Mesh> mesh_;
  std::unique_ptr<MeshScene> scene_;  // refers to it
};

// Copies are the same cache.
class MeshCache {
 public:
  using Held = std::shared_ptr<const TexturedMesh>;
  // Called from several threads at once, one of them the cache's own; the same for the same index.
  // Destroyed once all meshes are in memory and none had to leave.
  using Read = std::function<Result<TexturedMesh>(std::size_t index)>;

  // Of indices in [0, count). Above `bytes`, the meshes least recently used leave; beside them
  // there are those that are held, and one for each thread that reads.
  MeshCache(std::size_t count, std::size_t bytes, Read read);

  // Reads it unless it is there. Thread-safe. Errors: those of reading.
  Result<Held> Get(std::size_t index) const;
  // These are wanted next, in this order: the cache's own thread reads those that are not there.
  void Expect(const std::vector<std::size_t>& indices) const;

  std::size_t size() const;
  std::size_t bytes() const;  // in memory
  bool full() const;          // a mesh had to leave

 private:
  class State;
  std::shared_ptr<State> state_;
};

}  // namespace tilegrad::train
