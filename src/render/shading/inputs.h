// SPDX-License-Identifier: Apache-2.0
// The scenes of a batch made ready for the renderer and its shade stage: lights with unit
// directions, textures with their levels, streams side by side as a plan says. Scratch that is
// reused.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "render/pipeline/records.h"
#include "render/scene_fields.h"
#include "render/shading/pack.h"
#include "render/shading/plan.h"
#include "render/shading/report.h"
#include "render/shading/stage.h"
#include "tilegrad/status.h"

namespace tilegrad {

// What to lay side by side.
struct StreamSets {
  const VaryingSet& varyings;              // forward, or what is pulled on
  bool normals = false;                    // normals are needed, derived if the scene says so
  const VaryingSet* recomputed = nullptr;  // on the way back, where it is not the same
};

class ShadeInputs {
 public:
  explicit ShadeInputs(const Workers& workers) : workers_(&workers) {}

  // Everything but streams, which Pack or UsePlain adds. `textures`: whether they are sampled.
  void Begin(std::span<const Scene> scenes, bool textures);
  // Streams side by side. Error: normals of positions that overflow float.
  Status Pack(std::span<const Scene> scenes, const StreamSets& sets);
  // Streams as they are: colours, user attributes, or none.
  void UsePlain(std::span<const Scene> scenes, bool colors, bool user);

  std::span<const StageScene> scenes() const { return stage_scenes_; }
  std::span<const PipelineScene> views() const { return views_; }  // with the streams as attributes
  // After Pack.
  const SceneNormals& normals(std::size_t scene) const {
    return packs_[pack_of_scene_[scene]].normals;
  }
  const SceneWork& work() const { return work_; }  // since Begin

 private:
  // What is packed of a scene, or of several that share their arrays.
  struct ScenePack {
    SceneNormals normals;
    AlignedVector<float> varyings;    // forward, or pulled
    AlignedVector<float> recomputed;  // where it is not the same
  };

  void PrepareTextures(std::span<const Scene> scenes);
  void FindPacks(std::span<const Scene> scenes);
  void DerivePackNormals(std::span<const Scene> scenes);
  bool PackStreams(std::span<const Scene> scenes, const StreamSets& sets);  // all are finite

  const Workers* workers_;
  SceneWork work_;
  std::vector<StageScene> stage_scenes_;
  std::vector<PipelineScene> views_;
  std::vector<ScenePack> packs_;
  std::vector<std::size_t> pack_of_scene_, first_of_pack_;
  std::vector<std::unique_ptr<shade::TexturePyramid>> pyramids_;
  std::vector<shade::TextureView> pyramid_views_;
};

}  // namespace tilegrad
