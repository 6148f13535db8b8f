// SPDX-License-Identifier: Apache-2.0
// The numbers of a scene on the tape: free of constraints, as an optimiser moves them.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "fit/scene.h"
#include "nn/nn.h"

namespace tilegrad::train {

// Each view has a block of its own.
inline bool IsOfOneView(Parameter what) {
  return what == Parameter::kCamera || what == Parameter::kExposure;
}

struct ParameterBlock {
  Parameter what = Parameter::kPositions;
  int view = -1;  // where IsOfOneView
  nn::Var value;  // a leaf of the tape where it is free, else a constant

  std::string name() const;  // "positions", "camera/3"
};

// Positions and colours are [1,V,3], texels [1,h,w,3], texture coordinates [U,2], harmonics [1,9],
// as they are. A camera [9]: the six numbers of rotation (tilegrad/camera.h), then where the
// scene's pivot is in camera axes, by the scene's unit. Light [1,3]: its direction. Material
// [1,10]: ambient, diffuse, specular, and the logarithm of shininess + 1. Exposure [1]: the
// logarithm of the view's gain. Focal [1]: the logarithm of one factor of all focal lengths, at
// first 0.
class Unknowns {
 public:
  // `scene` must outlive this and keep its faces.
  Unknowns(nn::Context& context, const FitScene& scene, const ParameterSet& free);

  // What images depend on. Cameras, materials and the focal length are there only if they are free:
  // the scene has them.
  std::span<const ParameterBlock> blocks() const { return blocks_; }

  RenderedImages Render(SceneRenderer* renderer, const FitRenderer::Job& job) const;
  // [N,1,1,1], what the colours of these views are to be multiplied by; invalid: 1.
  nn::Var Gains(std::span<const int> views) const;

  // From the block into `scene`. Colours and texels are held to [0, 1], materials to >= 0, in the
  // block too. Writing twice changes nothing. An error if a camera has lost its rotation.
  Status Write(const ParameterBlock& block, FitScene* scene) const;

 private:
  void Add(Parameter what, int view = -1);
  bool IsThere(Parameter what) const;
  const nn::Var& Of(Parameter what, int view = -1) const;
  RenderJob JobOf(const FitRenderer::Job& job) const;
  SceneVars VarsOf(const FitRenderer::Job& job) const;
  nn::Var Harmonics() const;
  nn::Var Cameras(const FitRenderer::Job& job) const;
  void WriteFocal(float logarithm, FitScene* scene) const;

  nn::Context& context_;
  const FitScene& scene_;
  ParameterSet free_;
  std::vector<std::array<float, 2>> focal_;  // of the views, at first
  std::vector<ParameterBlock> blocks_;
  nn::Tensor uv_indices_;
};

}  // namespace tilegrad::train
