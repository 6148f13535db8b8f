// SPDX-License-Identifier: Apache-2.0
// What the network should have said of the lights of a batch, found by trying (LightSearch). Of
// each input the object is drawn without light as its other view says that it looks; the light that
// makes this most like the input is the target. With the texture of the same view the network would
// learn to repeat itself: that one was looked up under the light that it said.
#pragma once

#include "train/models/texture_network.h"
#include "train/ops/render_op.h"
#include "train/tasks/textured_image/batch.h"
#include "train/tasks/textured_image/light_search.h"

namespace tilegrad::train {

// What `objects` says of light that LightTargets has targets for: directions or harmonics.
inline const nn::Var& SaidOf(const Prediction& objects) {
  return objects.sh.valid() ? objects.sh : objects.directions;
}

class LightTargets {
 public:
  LightTargets(nn::Context& context, const LightConfig& config);

  // In the axes of the inputs' cameras, without gradient: [M, 3] unit directions, of harmonics
  // [M, 9]; what `objects` says itself of inputs in which too little is seen. `job` draws the
  // batch; its shading is replaced. An empty tensor where drawing failed, which the context's
  // status then says.
  nn::Tensor Find(const Prediction& objects, const TexturedBatch& batch, RenderJob job);

 private:
  nn::Context& context_;
  LightSearch search_;
  SceneRenderer renderer_;
};

}  // namespace tilegrad::train
