// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.1: images -> network -> renderer -> losses of equation 14 ->
// gradients -> Adam.
#pragma once

#include <memory>
#include <optional>

#include "nn/moving_average.h"
#include "nn/optim.h"
#include "scene/topology.h"
#include "train/data/batches.h"
#include "train/data/stream/scene_stream.h"
#include "train/ops/render_op.h"
#include "train/ops/rival_op.h"
#include "train/run/step_values.h"
#include "train/tasks/single_image/config.h"

namespace tilegrad::train {

struct LossValues {
  double total = 0, iou = 0, color = 0, smoothness = 0, laplacian = 0;  // the parts are unweighted
  bool has_color = true;  // false where the rule draws alpha alone
};

// The tensors of one batch: what the network sees, and what the renders are held to.
struct BatchTensors {
  nn::Tensor input;             // [B, 4, size, size]
  nn::Tensor truth_colors;      // [B * views, 3, size, size]
  nn::Tensor truth_alpha;       // [B * views, size, size]
  std::vector<Camera> cameras;  // [B * views]
};
BatchTensors GatherBatch(nn::Context& context, const ImageStore& store,
                         const std::vector<Sample>& batch);
// The first objects of the batch, which is that of `step`, are rendered instead; null: none are.
Result<BatchTensors> GatherBatch(nn::Context& context, const ImageStore& store,
                                 const std::vector<Sample>& batch, SceneStream* stream,
                                 std::int64_t step);

// The learning rate and 1/delta of a step: both follow schedules of the configuration.
double LearningRateAt(const SingleImageConfig& config, std::int64_t step);
double SharpnessAt(const SingleImageConfig& config, std::int64_t step);

// Network, optimiser and renderer of a run.
class TrainStep {
 public:
  // The words of config.render and config.rivals are known (RivalOptions).
  TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size);

  // Equation 14 of a batch, on the tape; `values` gets the parts.
  nn::Var Loss(const BatchTensors& batch, std::int64_t step, LossValues* values);
  // Gradients of the loss. A loss or gradient that is not finite is an error.
  Result<nn::StepVector<nn::Gradient>> Backward(const BatchTensors& batch, std::int64_t step,
                                                LossValues* values);
  // One step of Adam, and of the moving average of the weights if there is one.
  Status Update(std::span<const nn::Gradient> gradients, std::int64_t step);
  // Appends the same by name and weight.
  void AddTerms(const LossValues& values, std::vector<LossTerm>* terms) const;

  MeshNetwork& network() { return network_; }
  nn::Adam& adam() { return adam_; }
  nn::MovingAverage& average() { return average_; }  // of no tensors without optimizer.average
  SceneRenderer& renderer() { return renderer_; }
  RenderOptions OptionsAt(std::int64_t step) const;
  std::span<const std::int32_t> faces() const;

 private:
  // Whether the rule draws colours, which the colour loss needs.
  bool HasColor() const;
  // The images that losses look at.
  RenderedImages Draw(const PredictedMeshes& meshes, const BatchTensors& batch, std::int64_t step);

  nn::Context& context_;
  SingleImageConfig config_;
  int image_size_;
  MeshNetwork network_;
  nn::Adam adam_;
  nn::MovingAverage average_;
  Topology topology_;
  SceneRenderer renderer_;
  std::optional<rivals::Options> rival_;  // instead of ours
  RivalRenderer rival_renderer_;
};

}  // namespace tilegrad::train
