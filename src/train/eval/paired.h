// SPDX-License-Identifier: Apache-2.0
// Two runs on the same held-out models. Models differ far more than runs do, so the difference of
// two means is known much better than either.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "train/eval/measures.h"
#include "train/eval/standard_error.h"

namespace tilegrad::train {

struct PairedDifference {
  const ScoreMeasure* measure;
  ClassedMean difference;  // of the first run minus the second
  // Less than two standard errors, or one that is not known.
  bool tie() const;
  bool better() const { return (difference.mean > 0) != measure->less_is_better; }
};

struct PairedComparison {
  std::string predictor;                   // of the second run
  int models = 0;                          // that both have scores of
  std::vector<PairedDifference> measures;  // that all of these have in both
};

// By the models of Evaluation::models that both have: mean over the models of a shape, over shapes
// and over classes. An error where there are none.
Result<PairedComparison> ComparePaired(const Evaluation& first, const Evaluation& second);

// A line a measure: "3D IoU  +1.3 ± 0.4  better".
std::string FormatComparison(const PairedComparison& comparison);
nlohmann::ordered_json ComparisonJson(const PairedComparison& comparison);

}  // namespace tilegrad::train
