// SPDX-License-Identifier: Apache-2.0
// How far means over held-out models would move with another draw of models.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "train/eval/evaluation.h"

namespace tilegrad::train {

struct ClassedMean {
  double mean = 0;              // over classes of means over shapes
  std::optional<double> error;  // its standard error; none: no class has two shapes
};

// classes[c]: a number of each shape of a class; classes without any do not count. Classes are
// fixed and shapes are drawn from them; the spread within a class is taken to be the same in all,
// since few have more than a handful.
ClassedMean MeanOverClasses(std::span<const std::vector<double>> classes);

// The errors of all measures, each over the shapes that have it; a measure without one is not
// there. None where iou, which all have, has none.
std::optional<Score> StandardErrors(std::span<const std::vector<Score>> classes);

}  // namespace tilegrad::train
