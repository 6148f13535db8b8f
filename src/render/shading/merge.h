// SPDX-License-Identifier: Apache-2.0
// Last stage of the backward pass of shading: turns the cotangents of a scene's streams and the
// sums of bands into gradients of the scene. Sums are formed in the order of scenes and bands.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "render/gradient_targets.h"
#include "render/pipeline/records.h"
#include "render/shading/inputs.h"
#include "render/shading/plan.h"
#include "render/shading/stage.h"
#include "shade/texture_levels.h"

namespace tilegrad {

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
