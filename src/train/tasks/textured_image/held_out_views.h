// SPDX-License-Identifier: Apache-2.0
// Views of held-out models for scores and reports: from fixed seeds, undeformed, each under its own
// light.
#pragma once

#include <optional>

#include "train/data/dataset.h"
#include "train/tasks/task.h"
#include "train/tasks/textured_image/config.h"

namespace tilegrad::train {

class HeldOutViews {
 public:
  struct Request {
    const TexturedImageConfig& config;
    const Dataset& dataset;
    std::vector<int> models;  // indices into the dataset's
  };
  static Result<HeldOutViews> Load(const Request& request, const Workers& workers,
                                   const Watch& watch);

  // Pictures of `count` views of models[i], [count][4][size][size] each. The same model
  // of one dataset is always seen in the same views.
  struct Views {
    std::vector<TexturedView> views;
    std::vector<float> lit, texture, light, normals;
    std::span<const float> Of(const std::vector<float>& pictures, std::size_t view) const {
      const std::size_t size = pictures.size() / views.size();
      return std::span(pictures).subspan(view * size, size);
    }
  };
  Result<Views> Draw(std::size_t i, int count);
  // The same of chosen views.
  Result<Views> Show(std::size_t i, std::vector<TexturedView> views);
  const std::vector<int>& models() const { return models_; }

 private:
  HeldOutViews() = default;
  Status Fill(Views* out);
  std::vector<int> models_;
  std::optional<TexturedStream> stream_;
};

// Table 2 of the paper, with baselines that ignore the light.

// On held-out models in views_per_model views each (HeldOutViews), with the true cameras. Of each
// view: texture L1, angle of the light, texture + light L1 (evaluation.h; over the whole image),
// and the scores of the shape. Rows with the predicted shape and texture: "without light", "mean
// light" (of training: what a constant scores), "tilegrad". The four before the last use
// LightSearch's light of the same picture, given the predicted or true shape and texture: they
// attribute the light's error to these. Without a light model only the last row. Errors: as
// CheckHeldOut and OpenTexturedMeshes; a job with a change.
Result<Evaluation> EvaluateTextured(const TexturedImageConfig& config, const TaskEvaluation& job,
                                    const Workers& workers, const Watch& watch);

}  // namespace tilegrad::train
