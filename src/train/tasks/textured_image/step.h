// SPDX-License-Identifier: Apache-2.0
// One training step of section 5.2: images -> network -> renderer under the predicted lights ->
// losses of equation 14 -> gradients -> Adam.
//
// One picture cannot separate dark paint from dim light. So each object has two views under two
// lights, and the texture predicted from one must explain the other under that one's light.
#pragma once

#include <vector>

#include "nn/context.h"
#include "train/data/batches.h"
#include "train/data/stream/textured_stream.h"
#include "train/models/render_op.h"
#include "train/models/texture_network.h"
#include "train/run/log.h"
#include "train/tasks/network_task.h"
#include "train/tasks/next_batch.h"
#include "train/tasks/task.h"
#include "train/tasks/textured_image/config.h"
#include "train/tasks/textured_image/light_search.h"

namespace tilegrad::train {

// The data of a step: objects in two views, each under its own light.

inline constexpr int kViewsOfObject = 2;

// M = 2 B inputs: 2 b and 2 b + 1 are the views of object b. The mesh predicted from input m is
// rendered in two of N = 2 M images: 2 m in its own view, 2 m + 1 in the object's other view.
struct TexturedBatch {
  nn::Tensor input;                 // [M, 4, size, size]
  nn::Tensor truth_colors;          // [N, 3, size, size]
  nn::Tensor truth_alpha;           // [N, size, size]
  std::vector<Camera> cameras;      // [N]
  std::vector<TexturedView> views;  // [M]
  Portion portion{};                // of the step's batch
  double stream_seconds = 0;        // of processor time, for its pictures
};

// The input whose view image n shows.
constexpr std::size_t InputOfImage(std::size_t n) { return n % 2 == 0 ? n / 2 : (n / 2) ^ 1; }

// One object for each of `models`. `first`: position in the run of the first. The stream outlives
// the work, whose lanes are the stream's.
BatchWork<TexturedBatch> RenderWork(nn::Context& context, TexturedStream& stream, int size,
                                    std::vector<Sample> models, std::int64_t first);
// The same, on all workers.
Result<TexturedBatch> RenderBatch(nn::Context& context, TexturedStream& stream, int size,
                                  const std::vector<Sample>& models, std::int64_t first);

// Targets for the predicted lights of a batch: the light (LightSearch) that makes the object, unlit
// with the texture predicted from its other view, most like the input. The texture of the same view
// depends on the predicted light, so the network would learn to repeat itself.

// The predicted lights that LightTargets has targets for: directions or harmonics.
inline const nn::Var& PredictedLights(const Prediction& objects) {
  return objects.sh.valid() ? objects.sh : objects.directions;
}

class LightTargets {
 public:
  LightTargets(nn::Context& context, const LightConfig& config);

  // In the axes of the inputs' cameras, without gradient: [M, 3] unit directions, for harmonics [M,
  // 9]; the prediction itself for inputs that show too little. `job` draws the batch; its shading
  // is replaced. An empty tensor if drawing failed: the context's status has the error.
  nn::Tensor Find(const Prediction& objects, const TexturedBatch& batch, RenderJob job);

 private:
  nn::Context& context_;
  LightSearch search_;
  nn::PerLane<SceneRenderer> renderer_;
};

// The inputs of the losses and of image critics.
struct TexturedRenders {
  Prediction objects;     // of the inputs
  RenderedImages images;  // of TexturedBatch::cameras
};

class TexturedStep {
 public:
  TexturedStep(nn::Context& context, const TexturedImageConfig& config, int image_size);

  // Network and renderer, on the tape. One call at a time: the images belong to one renderer.
  TexturedRenders Draw(const TexturedBatch& batch, std::int64_t step);
  // Equation 14 with textures and light; `values` gets the sum and its terms.
  nn::Var Loss(const TexturedRenders& renders, const TexturedBatch& batch, std::int64_t step,
               StepValues* values);
  // Loss adds its terms; null: none. `adversary` outlives the steps.
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
  nn::PerLane<SceneRenderer> renderer_;
  LightTargets light_targets_;
  nn::PerLane<RivalRenderer> rival_renderer_;  // if the rule is N3MR's
  Adversary* adversary_ = nullptr;
};

// Degrees between two directions, neither 0.
double AngleBetween(const std::array<float, 3>& a, const std::array<float, 3>& b);
// Row `row` of the lights of a batch of predictions.
DrawnLight LightOf(const Prediction& objects, std::size_t row);
// For harmonics that of their linear part, else the light's own.
std::array<float, 3> DirectionOf(const DrawnLight& light, Lighting lighting);

}  // namespace tilegrad::train
