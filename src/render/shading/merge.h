// SPDX-License-Identifier: Apache-2.0
// Last stage of the way back through shading: what bands have summed, to gradients of lights,
// coefficients, surfaces, cameras and textures. Sums are made in the order of scenes and bands.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "render/scene_fields.h"
#include "render/shading/stage.h"
#include "shade/texture_levels.h"

namespace tilegrad {

// Overwrites lights, sh and surfaces of d_scenes where they are wanted, and adds to cameras.
void MergeUniforms(const ShadeStage& stage, std::span<const StageScene> scenes,
                   std::span<const SceneGradients> d_scenes, SceneSums* scratch);

// Sets them to 0.
void ClearUniforms(std::span<const SceneGradients> d_scenes);
// Where no texture is pulled on.
void ClearTextures(std::span<const SceneGradients> d_scenes);

// Gradients of textures, each in an array of its own. Scratch that is reused.
class TextureMerge {
 public:
  // Overwrites textures of d_scenes where they are wanted.
  void Run(const ShadeStage& stage, std::span<const StageScene> scenes, const Workers& workers,
           std::span<const SceneGradients> d_scenes);

 private:
  // An array of the caller and the texture that it is the gradient of; scenes may share it.
  struct Target {
    std::span<float> out;
    const shade::TexturePyramid* pyramid;
  };
  void FindTargets(std::span<const StageScene> scenes, std::span<const SceneGradients> d_scenes);

  std::vector<Target> targets_;
  std::vector<std::unique_ptr<shade::TextureGradient>> gradients_;
};

}  // namespace tilegrad
