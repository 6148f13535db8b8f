// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.1: images -> network -> renderer -> losses of equation 14 ->
// gradients -> Adam.
#pragma once

#include <optional>
#include <vector>

#include "nn/context.h"
#include "scene/camera.h"
#include "train/data/batches.h"
#include "train/data/stream/textured_stream.h"
#include "train/models/mesh_network.h"
#include "train/models/render_op.h"
#include "train/run/log.h"
#include "train/tasks/network_task.h"
#include "train/tasks/next_batch.h"
#include "train/tasks/single_image/config.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// Equation 14: meshes -> renderer -> losses against the pictures.

// The pictures of one step as tensors, from the dataset or rendered for it.

// The tensors of one batch: the network's input and the renders' targets.
struct BatchTensors {
  nn::Tensor input;             // [B, 4, size, size]
  nn::Tensor truth_colors;      // [B * views, 3, size, size]
  nn::Tensor truth_alpha;       // [B * views, size, size]
  std::vector<Camera> cameras;  // [B * views]
  double stream_seconds = 0;    // of processor time, to render its pictures
};
BatchTensors GatherBatch(nn::Context& context, const ImageStore& store,
                         const std::vector<Sample>& batch);
// The first objects of a batch, which are rendered for it.
struct StreamedObjects {
  TexturedStream* from = nullptr;  // null: all come from the store
  std::int64_t first = 0;          // position in the run of the batch's first object
};
// `store` and the stream outlive the work, whose lanes are the stream's.
BatchWork<BatchTensors> GatherWork(nn::Context& context, const ImageStore& store,
                                   std::vector<Sample> batch, const StreamedObjects& stream);

class ImageLosses {
 public:
  // Losses of deformed copies of `sphere`, which outlives this. The words of config.render and
  // config.rivals must be valid (RivalOptions).
  ImageLosses(nn::Context& context, const SingleImageConfig& config, const SphereModel& sphere,
              int image_size);

  // On the tape; `values` gets the sum and its terms.
  nn::Var Total(const Prediction& meshes, const BatchTensors& batch, std::int64_t step,
                StepValues* values);

  SceneRenderer& renderer() { return renderer_.Here(); }
  // Uses our renderer, whichever one trains.
  RenderedImages DrawOurs(const Prediction& meshes, const BatchTensors& batch, std::int64_t step);

 private:
  // Whether the rule draws colours, which the colour loss needs.
  bool HasColor() const;
  // The images that the losses compare.
  RenderedImages Draw(const Prediction& meshes, const BatchTensors& batch, std::int64_t step);

  SingleImageConfig config_;
  int image_size_;
  const SphereModel& sphere_;
  nn::PerLane<SceneRenderer> renderer_;
  std::optional<rivals::Options> rival_;  // instead of ours
  nn::PerLane<RivalRenderer> rival_renderer_;
};

// Network, optimiser and renderer of a run.
class TrainStep {
 public:
  // The words of config.render and config.rivals must be valid (RivalOptions).
  TrainStep(nn::Context& context, const SingleImageConfig& config, int image_size);

  // Equation 14 of a batch, on the tape; `values` gets the sum and its terms.
  nn::Var Loss(const BatchTensors& batch, std::int64_t step, StepValues* values);

  MeshNetwork& network() { return network_; }
  LearnedWeights& weights() { return weights_; }
  ImageLosses& losses() { return losses_; }

 private:
  nn::Context& context_;
  SingleImageConfig config_;
  MeshNetwork network_;
  LearnedWeights weights_;
  ImageLosses losses_;
};

}  // namespace tilegrad::train
