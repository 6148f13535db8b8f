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
#include "raster/attributes.h"
#include "render/gradient_targets.h"
#include "render/pipeline/records.h"
#include "render/scene_fields.h"
#include "render/shading/plan.h"
#include "render/shading/report.h"
#include "render/shading/stage.h"
#include "shade/mesh_normals.h"
#include "shade/texture_levels.h"
#include "tilegrad/status.h"

namespace tilegrad {

// The streams of a scene side by side, as the renderer interpolates them, and gradients taken apart
// again.

// Normals of a scene, where they are derived from its positions: [V] or [F].
using SceneNormals = AlignedVector<shade::UnitVector<float>>;
void DeriveNormals(const Scene& scene, SceneNormals* normals);

// out [rows][channels] in the rate of the set. `normals` as DeriveNormals makes them.
void PackVaryings(const Scene& scene, const VaryingSet& set, const SceneNormals& normals,
                  AlignedVector<float>* out);

// Adds what `packed` [rows][channels], a gradient of PackVaryings' array, says of one stream to
// `stream`: as in the scene; positions for kPosition; for derived normals, [V] or [F] of three.
void AddStream(const Scene& scene, const VaryingSet& set, Varying what,
               std::span<const float> packed, std::span<float> stream);

// Adds to d_positions the adjoint of DeriveNormals. d_units [V] or [F] is overwritten.
void AddNormalsAdjoint(const Scene& scene, const SceneNormals& normals,
                       std::span<shade::Vec3<float>> d_units, std::span<float> d_positions);

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

// Last stage of the backward pass of shading: turns the cotangents of a scene's streams and the
// sums of bands into gradients of the scene. Sums are formed in the order of scenes and bands.

// Scratch that is reused.
class GradientMerge {
 public:
  using Targets = GradientTargets<float>;

  explicit GradientMerge(const Workers& workers) : workers_(&workers) {}

  // Where Pipeline::Backward is to write, given the views that it gets: scratch of each scene.
  std::span<PipelineGradients> Begin(const BackwardPlan& plan, std::span<const PipelineScene> views,
                                     const Targets& targets);

  // What a merge is about.
  struct Batch {
    const BackwardPlan& plan;
    const ShadeInputs& inputs;
    const ShadeStage* stage;  // null: none has run
    const Targets& targets;
  };
  // Overwrites the arrays of the targets and their scenes' own records.
  void Run(const Batch& batch);

 private:
  // Of one scene before they are summed.
  struct SceneScratch {
    AlignedVector<float> d_varyings, d_positions;
    AlignedVector<shade::Vec3<float>> d_units;
  };
  // The array of a texture's gradient.
  struct TextureTarget {
    std::span<const Targets::Target> array;
    const shade::TexturePyramid* pyramid;
  };

  void AddToPositions(const Batch& batch, std::size_t n);
  void FillArray(const Batch& batch, std::span<const Targets::Target> array) const;
  void MergeUniforms(const Batch& batch);
  void MergeTextures(const Batch& batch);
  void FindTextures(const Batch& batch);

  const Workers* workers_;
  std::vector<SceneScratch> scratch_;
  std::vector<PipelineGradients> d_views_;
  SceneSums sums_;
  std::vector<TextureTarget> textures_;
  std::vector<std::unique_ptr<shade::TextureGradient>> texture_gradients_;
};

}  // namespace tilegrad
