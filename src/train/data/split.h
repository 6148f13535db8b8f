// SPDX-License-Identifier: Apache-2.0
// Which models train, validate and test: by model, never by view.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "train/data/dataset.h"

namespace tilegrad::train {

struct SplitRule {
  double test_share = 0.2, validation_share = 0.0;  // of each class's shapes
  std::uint64_t seed = 0;
};

// A hash of text that is the same on every machine.
std::uint64_t HashText(std::string_view text, std::uint64_t seed);

// Sets models[i].split. Models of one class with the same `geometry` (not 0) or the same `shape`
// form a group that is never divided. Groups are ordered by a hash of seed, class and shape
// (ShapeOf); the first whose shapes fit into the share are the test set, then validation, and the
// rest train: a shape with many textures counts once. A class of two groups or more has at least
// one training model and, if test_share is above 0, one test model.
void SplitModels(const std::vector<std::string>& classes, const SplitRule& rule,
                 std::vector<ModelInfo>* models);

}  // namespace tilegrad::train
