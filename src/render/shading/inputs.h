// SPDX-License-Identifier: Apache-2.0
// Prepares the scenes of a batch for the renderer and its shade stage: lights with unit directions,
// textures with mip levels, streams packed according to a plan. Reuses its scratch.
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

// Packs the streams of a scene as the renderer interpolates them, and unpacks gradients.

// Normals of a scene derived from its positions: [V] or [F].
using SceneNormals = AlignedVector<shade::UnitVector<float>>;
void DeriveNormals(const Scene& scene, SceneNormals* normals);

// out [rows][channels] at the rate of the set. `normals` from DeriveNormals.
void PackVaryings(const Scene& scene, const VaryingSet& set, const SceneNormals& normals,
                  AlignedVector<float>* out);

// Adds the gradient of one stream in `packed` [rows][channels], the gradient of PackVaryings'
// output, to `stream`: as in the scene; positions for kPosition; for derived normals, [V] or [F] of
// three.
void AddStream(const Scene& scene, const VaryingSet& set, Varying what,
               std::span<const float> packed, std::span<float> stream);

// Adds the adjoint of DeriveNormals to d_positions. Overwrites d_units [V] or [F].
void AddNormalsAdjoint(const Scene& scene, const SceneNormals& normals,
                       std::span<shade::Vec3<float>> d_units, std::span<float> d_positions);

// The streams to pack.
struct StreamSets {
  const VaryingSet& varyings;              // forward, or those with a requested cotangent
  bool normals = false;                    // normals are needed, derived if the scene says so
  const VaryingSet* recomputed = nullptr;  // in the backward pass, if different
};

class ShadeInputs {
 public:
  explicit ShadeInputs(const Workers& workers) : workers_(&workers) {}

  // Prepares everything but streams, which Pack or UsePlain adds. `textures`: whether they are
  // sampled.
  void Begin(std::span<const Scene> scenes, bool textures);
  // Packs streams. Error: normals of positions that overflow float.
  Status Pack(std::span<const Scene> scenes, const StreamSets& sets);
  // Uses streams unpacked: colours, user attributes, or none.
  void UsePlain(std::span<const Scene> scenes, bool colors, bool user);

  std::span<const StageScene> scenes() const { return stage_scenes_; }
  std::span<const PipelineScene> views() const { return views_; }  // with the streams as attributes
  // After Pack.
  const SceneNormals& normals(std::size_t scene) const {
    return packs_[pack_of_scene_[scene]].normals;
  }
  const SceneWork& work() const { return work_; }  // since Begin

 private:
  // The packed streams of a scene, or of several that share their arrays.
  struct ScenePack {
    SceneNormals normals;
    AlignedVector<float> varyings;    // forward, or pulled
    AlignedVector<float> recomputed;  // if different
  };

  void PrepareTextures(std::span<const Scene> scenes);
  void FindPacks(std::span<const Scene> scenes);
  void DerivePackNormals(std::span<const Scene> scenes);
  bool PackStreams(std::span<const Scene> scenes, const StreamSets& sets);  // false: not finite

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
// sums of bands into gradients of the scene. Sums in the order of scenes and bands.

// Reuses its scratch.
class GradientMerge {
 public:
  using Targets = GradientTargets<float>;

  explicit GradientMerge(const Workers& workers) : workers_(&workers) {}

  // The destinations for Pipeline::Backward, given its views: scratch of each scene.
  std::span<PipelineGradients> Begin(const BackwardPlan& plan, std::span<const PipelineScene> views,
                                     const Targets& targets);

  // Input of a merge.
  struct Batch {
    const BackwardPlan& plan;
    const ShadeInputs& inputs;
    const ShadeStage* stage;  // null: no stage ran
    const Targets& targets;
  };
  // Overwrites the arrays of the targets and their per-scene records.
  void Run(const Batch& batch);

 private:
  // Gradients of one scene before summation.
  struct SceneScratch {
    AlignedVector<float> d_varyings, d_positions;
    AlignedVector<shade::Vec3<float>> d_units;
  };
  // The gradient array of a texture.
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
