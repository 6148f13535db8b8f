// SPDX-License-Identifier: Apache-2.0
// Targets for the lights that the network predicts for a batch, found by search (LightSearch). The
// object is drawn unlit with the texture predicted from its other view; the target is the light
// that makes this most like the input. The texture of the same view depends on the predicted light,
// so the network would learn to repeat itself.
#pragma once

#include "train/models/texture_network.h"
#include "train/ops/render_op.h"
#include "train/tasks/textured_image/batch.h"
#include "train/tasks/textured_image/light_search.h"

namespace tilegrad::train {

// The predicted lights that LightTargets has targets for: directions or harmonics.
inline const nn::Var& PredictedLights(const Prediction& objects) {
  return objects.sh.valid() ? objects.sh : objects.directions;
}

class LightTargets {
 public:
  LightTargets(nn::Context& context, const LightConfig& config);

  // In the axes of the inputs' cameras, without gradient: [M, 3] unit directions, of harmonics
  // [M, 9]; the prediction itself for inputs that show too little. `job` draws the batch; its
  // shading is replaced. An empty tensor if drawing failed: the context's status has the error.
  nn::Tensor Find(const Prediction& objects, const TexturedBatch& batch, RenderJob job);

 private:
  nn::Context& context_;
  LightSearch search_;
  SceneRenderer renderer_;
};

}  // namespace tilegrad::train
