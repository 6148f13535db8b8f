// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.4: photographs -> network -> renderer under weak perspective ->
// losses of CMR and DIB-R -> gradients.
#pragma once

#include <vector>

#include "nn/context.h"
#include "train/losses/laplacian.h"
#include "train/losses/loss_sum.h"
#include "train/models/render_op.h"
#include "train/run/log.h"
#include "train/run/portion.h"
#include "train/tasks/network_task.h"
#include "train/tasks/next_batch.h"
#include "train/tasks/photographs/config.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// The data of a step.

// B photographs of S pixels a side with K keypoints.
struct PhotographBatch {
  nn::Tensor input;                      // [B, 3, S, S], what the network sees
  nn::Tensor colors;                     // [B, 3, S, S], of the object over black
  nn::Tensor mask;                       // [B, S, S]
  nn::Tensor barrier;                    // [B, 1, S, S] DistanceBarrier; only with a flow
  nn::Tensor keypoints;                  // [B, K, 2], 0 where not visible; none without keypoints
  nn::Tensor visible;                    // [B, K, 1] 1 or 0
  std::vector<WeakPerspective> cameras;  // [B]
  std::vector<CroppedPhoto> crops;       // [B]
  Portion portion{};                     // of the step's batch
};

struct PhotographPlaces {
  std::vector<int> photographs;  // indices into the store
  std::int64_t first = 0;        // place in the run of the first one
};
// A random crop of each of `photographs`, determined by their places in the run: `first`, first +
// 1, ..; or with `first` < 0 the crop without jitter. `config` and `store` outlive the work.
BatchWork<PhotographBatch> PhotographWork(nn::Context& context, const PhotographsConfig& config,
                                          const PhotoStore& store, PhotographPlaces places);
// The same, on all workers.
PhotographBatch GatherPhotographs(nn::Context& context, const PhotographsConfig& config,
                                  const PhotoStore& store, const std::vector<int>& photographs,
                                  std::int64_t first);

class PhotographStep {
 public:
  PhotographStep(nn::Context& context, const PhotographsConfig& config,
                 const PhotographStart& start);

  // On the tape; `values` gets the sum and its terms.
  nn::Var Loss(const PhotographBatch& batch, std::int64_t step, StepValues* values);
  // Loss adds its terms; null: none. `adversary` outlives the steps.
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
  std::vector<WeighedEdge> edges_;  // of the initial mean shape
  nn::PerLane<SceneRenderer> renderer_, color_renderer_;
  Adversary* adversary_ = nullptr;
};

}  // namespace tilegrad::train
