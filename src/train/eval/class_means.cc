// SPDX-License-Identifier: Apache-2.0
#include "train/eval/class_means.h"

#include <utility>

#include "train/eval/scores.h"
#include "train/eval/standard_error.h"

namespace tilegrad::train {

ClassMeans::ClassMeans(const Dataset& dataset, std::span<const int> models) {
  std::map<int, int> counts;
  for (std::size_t i = 0; i < models.size(); ++i) {
    const ModelInfo& info = dataset.models()[static_cast<std::size_t>(models[i])];
    members_[info.class_index][ShapeOf(info)].push_back(i);
    ++counts[info.class_index];
  }
  for (const auto& [class_index, count] : counts) {
    classes_.push_back(dataset.info().classes[static_cast<std::size_t>(class_index)]);
    class_models_.push_back(count);
  }
}

EvaluationRow ClassMeans::Row(const std::string& method, std::span<const Score> scores) const {
  EvaluationRow row{.method = method, .classes = {}, .mean = {}};
  std::vector<std::vector<Score>> shapes_of_classes;
  for (const auto& [class_index, shapes] : members_) {
    std::vector<Score> of_class;
    for (const auto& [shape, indices] : shapes) {
      std::vector<Score> of_shape;
      for (const std::size_t i : indices) of_shape.push_back(scores[i]);
      of_class.push_back(MeanScore(of_shape));
    }
    row.classes.push_back(MeanScore(of_class));
    shapes_of_classes.push_back(std::move(of_class));
  }
  row.mean = MeanScore(row.classes);
  row.error = StandardErrors(shapes_of_classes);
  return row;
}

}  // namespace tilegrad::train
