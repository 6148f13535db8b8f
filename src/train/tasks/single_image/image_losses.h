// SPDX-License-Identifier: Apache-2.0
// Equation 14: meshes -> renderer -> losses against the pictures.
#pragma once

#include <optional>

#include "train/models/mesh_network.h"
#include "train/ops/render_op.h"
#include "train/ops/rival_op.h"
#include "train/run/step_values.h"
#include "train/tasks/single_image/batch_tensors.h"
#include "train/tasks/single_image/config.h"

namespace tilegrad::train {

class ImageLosses {
 public:
  // Of deformed copies of `sphere`, which outlives it. The words of config.render and config.rivals
  // are known (RivalOptions).
  ImageLosses(nn::Context& context, const SingleImageConfig& config, const SphereModel& sphere,
              int image_size);

  // On the tape; `values` gets the sum and its terms.
  nn::Var Total(const Prediction& meshes, const BatchTensors& batch, std::int64_t step,
                StepValues* values);

  SceneRenderer& renderer() { return renderer_; }
  // By our renderer, whichever renderer trains.
  RenderedImages DrawOurs(const Prediction& meshes, const BatchTensors& batch, std::int64_t step);

 private:
  // Whether the rule draws colours, which the colour loss needs.
  bool HasColor() const;
  // The images that losses look at.
  RenderedImages Draw(const Prediction& meshes, const BatchTensors& batch, std::int64_t step);

  SingleImageConfig config_;
  int image_size_;
  const SphereModel& sphere_;
  SceneRenderer renderer_;
  std::optional<rivals::Options> rival_;  // instead of ours
  RivalRenderer rival_renderer_;
};

}  // namespace tilegrad::train
