// SPDX-License-Identifier: Apache-2.0
// Statistics of scores: means over classes, their standard errors, and paired differences between
// runs.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "train/data/dataset.h"
#include "train/eval/evaluation.h"
#include "train/eval/scores.h"

namespace tilegrad::train {

// Averages scores of models over the models of a shape (ShapeOf), over the shapes of a class, and
// over classes.
class ClassMeans {
 public:
  // `models`: indices into the dataset's.
  ClassMeans(const Dataset& dataset, std::span<const int> models);
  // `scores`: one for each of the models.
  EvaluationRow Row(const std::string& method, std::span<const Score> scores) const;
  // Sets the dataset's source, classes that have models, and models; `scores`: the prediction's.
  void Describe(std::span<const Score> scores, Evaluation* out) const;

 private:
  const Dataset& dataset_;
  std::vector<int> models_;
  // class -> shape -> positions in `models_`
  std::map<int, std::map<std::string, std::vector<std::size_t>>> members_;
};

// A mean over held-out models with its sampling error.
struct ClassedMean {
  double mean = 0;              // over classes of means over shapes
  std::optional<double> error;  // its standard error; none: no class has two shapes
};

// classes[c]: a number for each shape of a class; empty classes do not count. Treats classes as
// fixed and shapes as drawn from them, and pools the variance within classes, since few have more
// than a handful.
ClassedMean MeanOverClasses(std::span<const std::vector<double>> classes);

// The standard errors of all measures, each over the shapes that have it, where there is one;
// nullopt if iou, which all have, has none.
std::optional<Score> StandardErrors(std::span<const std::vector<Score>> classes);

// Two runs on the same held-out models. Models differ far more than runs do, so the difference of
// two means is known much better than either.
struct PairedDifference {
  const ScoreMeasure* measure;
  ClassedMean difference;  // of the first run minus the second
  // Less than two standard errors, or the error is unknown.
  bool tie() const;
  bool better() const { return (difference.mean > 0) != measure->less_is_better; }
};

struct PairedComparison {
  std::string predictor;                   // of the second run
  int models = 0;                          // scored in both
  std::vector<PairedDifference> measures;  // that all of these have in both
};

// Over the models that both have in Evaluation::models: mean over the models of a shape, over
// shapes and over classes. An error if there are none.
Result<PairedComparison> ComparePaired(const Evaluation& first, const Evaluation& second);

// A line a measure: "3D IoU  +1.3 ± 0.4  better".
std::string FormatComparison(const PairedComparison& comparison);
nlohmann::ordered_json ComparisonJson(const PairedComparison& comparison);

}  // namespace tilegrad::train
