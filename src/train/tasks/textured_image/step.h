// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.2: images -> network -> renderer under the predicted lights ->
// losses of equation 14 -> gradients -> Adam.
//
// One picture cannot separate dark paint from dim light. So each object is seen in two views under
// two lights, and the texture predicted from one view must explain the other view under the light
// predicted from that view.
#pragma once

#include "train/ops/render_op.h"
#include "train/ops/rival_op.h"
#include "train/run/step_values.h"
#include "train/tasks/learned_weights.h"
#include "train/tasks/task.h"
#include "train/tasks/textured_image/batch.h"
#include "train/tasks/textured_image/config.h"
#include "train/tasks/textured_image/light_targets.h"

namespace tilegrad::train {

// What losses, and critics of the images, look at.
struct TexturedRenders {
  Prediction objects;     // of the inputs
  RenderedImages images;  // of TexturedBatch::cameras
};

class TexturedStep {
 public:
  TexturedStep(nn::Context& context, const TexturedImageConfig& config, int image_size);

  // Network and renderer, on the tape. One at a time: images are of one renderer.
  TexturedRenders Draw(const TexturedBatch& batch, std::int64_t step);
  // Equation 14 with textures and light; `values` gets the sum and its terms.
  nn::Var Loss(const TexturedRenders& renders, const TexturedBatch& batch, std::int64_t step,
               StepValues* values);
  // Its terms join Loss; without one there are none. `adversary` outlives the steps.
  void SetAdversary(Adversary* adversary) { adversary_ = adversary; }

  TextureNetwork& network() { return network_; }
  LearnedWeights& weights() { return weights_; }

 private:
  RenderedImages DrawN3mr(const Prediction& objects, const nn::Var& directions,
                          const TexturedBatch& batch);
  RenderJob JobAt(const TexturedBatch& batch, std::int64_t step) const;
  double ShareOfRun(std::int64_t step) const;
  nn::Var Covered(const nn::Var& colors, const TexturedBatch& batch) const;
  void AddAdversary(const RenderedImages& images, const TexturedBatch& batch, LossSum* sum) const;
  double LightAngle(const Prediction& objects, const TexturedBatch& batch) const;
  nn::Var LightLoss(const Prediction& objects, const TexturedBatch& batch);
  nn::Var PoseLoss(const nn::Var& pose, const TexturedBatch& batch) const;
  nn::Var ColorLoss(const RenderedImages& images, const TexturedBatch& batch,
                    std::int64_t step) const;

  nn::Context& context_;
  TexturedImageConfig config_;
  int image_size_;
  TextureNetwork network_;
  LearnedWeights weights_;
  SceneRenderer renderer_;
  LightTargets light_targets_;
  RivalRenderer rival_renderer_;  // if the rule is N3MR's
  Adversary* adversary_ = nullptr;
};

// Degrees between two directions, neither 0.
double AngleBetween(const std::array<float, 3>& a, const std::array<float, 3>& b);
// Row `row` of the lights of a batch of predictions.
DrawnLight LightOf(const Prediction& objects, std::size_t row);
// Of harmonics that of their linear part, else the light's own.
std::array<float, 3> DirectionOf(const DrawnLight& light, Lighting lighting);

}  // namespace tilegrad::train
