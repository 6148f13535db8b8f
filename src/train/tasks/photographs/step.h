// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.4: photographs -> network -> renderer under weak perspective ->
// losses of CMR and DIB-R -> gradients.
#pragma once

#include "train/losses/cotangent_laplacian.h"
#include "train/losses/loss_sum.h"
#include "train/ops/render_op.h"
#include "train/run/step_values.h"
#include "train/tasks/learned_weights.h"
#include "train/tasks/photographs/batch.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

class PhotographStep {
 public:
  PhotographStep(nn::Context& context, const PhotographsConfig& config,
                 const PhotographStart& start);

  // On the tape; `values` gets the sum and its terms.
  nn::Var Loss(const PhotographBatch& batch, std::int64_t step, StepValues* values);
  // Its terms join Loss; without one there are none. `adversary` outlives the steps.
  void SetAdversary(Adversary* adversary) { adversary_ = adversary; }

  PhotographNetwork& network() { return network_; }
  LearnedWeights& weights() { return weights_; }

 private:
  RenderedImages Draw(const Prediction& predicted, const PhotographBatch& batch, std::int64_t step);
  RenderJob JobAt(const PhotographBatch& batch, std::int64_t step) const;
  nn::Var CamerasOf(const Prediction& predicted, const PhotographBatch& batch) const;
  nn::Var KeypointLoss(const Prediction& predicted, const PhotographBatch& batch) const;
  nn::Var Masked(const nn::Var& colors, const PhotographBatch& batch) const;
  nn::Var FlowLoss(const nn::Var& flow, const PhotographBatch& batch) const;
  nn::Var CameraLoss(const nn::Var& cameras, const PhotographBatch& batch) const;
  void AddCamera(const Prediction& predicted, const PhotographBatch& batch, LossSum* sum) const;
  nn::Var Entropy() const;

  nn::Context& context_;
  PhotographsConfig config_;
  PhotographNetwork network_;
  LearnedWeights weights_;
  std::vector<WeighedEdge> edges_;  // of the mean shape as it starts
  SceneRenderer renderer_, color_renderer_;
  Adversary* adversary_ = nullptr;
};

}  // namespace tilegrad::train
