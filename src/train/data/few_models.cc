// SPDX-License-Identifier: Apache-2.0
#include "train/data/few_models.h"

#include <algorithm>
#include <iterator>

#include "base/error.h"

namespace tilegrad::train {

std::optional<std::string> AdviceOnFewModels(const std::vector<ModelInfo>& models, bool streamed) {
  std::vector<ModelInfo> training;
  std::copy_if(models.begin(), models.end(), std::back_inserter(training),
               [](const ModelInfo& model) { return model.split == Split::kTrain; });
  const std::size_t shapes = CountShapes(training);
  if (shapes >= (streamed ? kFewStreamedShapes : kFewShapes)) return std::nullopt;
  return fmt::format(
      "{} training shape{} few{}: a network memorises {} and does not generalise. Add models "
      "(--source procedural makes any number, --per-class), {}or, for one object, use `tilegrad "
      "fit`",
      shapes, shapes == 1 ? " is" : "s are",
      streamed ? ", also with streamed variants of each" : "", shapes == 1 ? "it" : "them",
      streamed ? "" : "train with --set stream.share=0.5 --set schedule.mirrored=0.5, ");
}

}  // namespace tilegrad::train
