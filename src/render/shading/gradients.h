// SPDX-License-Identifier: Apache-2.0
// Gradients of the arrays of meshes: what the renderer pulls on a scene's streams goes to scratch
// of the scene's own, and is then summed into the arrays of the caller, which scenes may share.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "render/pipeline/records.h"
#include "render/shading/inputs.h"
#include "render/shading/plan.h"

namespace tilegrad {

class ShadeGradients {
 public:
  explicit ShadeGradients(const Workers& workers) : workers_(&workers) {}

  // Where Pipeline::Backward is to write, given the views that it gets. Cameras are asked for as
  // d_scenes do.
  std::span<PipelineGradients> Begin(const BackwardPlan& plan, std::span<const PipelineScene> views,
                                     std::span<const SceneGradients> d_scenes);
  // Sums what it has written into the arrays of d_scenes, which are overwritten: in the order of
  // scenes, whatever the number of workers.
  void Merge(const BackwardPlan& plan, const ShadeInputs& inputs, std::span<const Scene> scenes,
             std::span<const SceneGradients> d_scenes);

 private:
  // Of one scene before they are merged.
  struct SceneScratch {
    AlignedVector<float> d_varyings, d_positions;
    AlignedVector<shade::Vec3<float>> d_units;
  };
  // One array of the caller, for a scene.
  struct Target {
    std::span<float> out;
    Varying what;  // kPosition: positions
    std::size_t scene;
  };
  // What a merge is about.
  struct Batch {
    const BackwardPlan& plan;
    const ShadeInputs& inputs;
    std::span<const Scene> scenes;
    std::span<const SceneGradients> d_scenes;
  };

  void AddToPositions(const Batch& batch, std::size_t scene);
  void FindTargets(std::span<const SceneGradients> d_scenes);
  void FillSink(const Batch& batch, const Target& sink) const;

  const Workers* workers_;
  std::vector<SceneScratch> scratch_;
  std::vector<PipelineGradients> d_views_;
  std::vector<Target> targets_;  // in the order of scenes
  std::vector<Target> sinks_;    // each array once, with the first scene that has it
};

}  // namespace tilegrad
