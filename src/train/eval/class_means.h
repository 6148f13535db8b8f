// SPDX-License-Identifier: Apache-2.0
// Scores of models to those of classes: mean over the models of a shape (ShapeOf), over the shapes
// of a class, and over classes.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "train/data/dataset.h"
#include "train/eval/evaluation.h"

namespace tilegrad::train {

class ClassMeans {
 public:
  // `models`: indices into the dataset's.
  ClassMeans(const Dataset& dataset, std::span<const int> models);
  const std::vector<std::string>& classes() const { return classes_; }    // that have models
  const std::vector<int>& class_models() const { return class_models_; }  // how many
  // `scores`: one for each of the models.
  EvaluationRow Row(const std::string& method, std::span<const Score> scores) const;

 private:
  // class -> shape -> positions in `models`
  std::map<int, std::map<std::string, std::vector<std::size_t>>> members_;
  std::vector<std::string> classes_;
  std::vector<int> class_models_;
};

}  // namespace tilegrad::train
