// SPDX-License-Identifier: Apache-2.0
// One array of numbers of a scene as an optimiser sees it: values without constraints, their
// gradient, and Adam's moments.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/aligned.h"
#include "fit/scene.h"

namespace tilegrad::train {

// Each view has a block of its own.
inline bool IsOfOneView(Parameter what) {
  return what == Parameter::kCamera || what == Parameter::kExposure;
}

struct ParameterBlock {
  Parameter what = Parameter::kPositions;
  int view = -1;             // where IsOfOneView
  double learning_rate = 0;  // in the values' units
  AlignedVector<float> values, gradient, m, v;
  std::int64_t steps = 0;                   // taken so far
  std::vector<std::array<float, 2>> focal;  // of kFocal: focal lengths that the value multiplies

  std::string name() const;  // "positions", "camera/3"
};

// kPositions, kColors, kTexture, kUv: as they are. kCamera: the six numbers of rotation
// (tilegrad/camera.h), then where the scene's pivot is in camera axes, by the scene's unit. kLight:
// directions. kMaterial: ambient, diffuse, specular, and the logarithm of shininess + 1. kExposure:
// the logarithm of the view's gain. kFocal: the logarithm of one factor of all focal lengths, at
// first 0.
ParameterBlock MakeBlock(const FitScene& scene, Parameter what, double learning_rate,
                         int view = -1);

// The block's values anew from the scene; the gradient has their size, moments stay.
void ReadBlock(const FitScene& scene, ParameterBlock* block);

// From the block into the scene. Colours and texels are held to [0, 1], materials to >= 0, in the
// block too. Writing twice changes nothing. An error if a camera has lost its rotation.
Status WriteBlock(ParameterBlock* block, FitScene* scene);

// block->gradient from what the renderer gave; of kCamera, from entry `rendered` of its cameras.
void PullBlock(const FitScene& scene, const FitGradients& gradients, std::size_t rendered,
               ParameterBlock* block);

}  // namespace tilegrad::train
