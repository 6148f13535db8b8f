// SPDX-License-Identifier: Apache-2.0
// Datasets that are too small for a network to learn anything from but themselves.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "train/data/dataset.h"

namespace tilegrad::train {

// Fewer training shapes (CountShapes) than this are few; streaming (data/stream) makes variants of
// each, so that less do.
inline constexpr std::size_t kFewShapes = 50, kFewStreamedShapes = 20;

// What to do about it, if the training models among these are few.
std::optional<std::string> AdviceOnFewModels(const std::vector<ModelInfo>& models, bool streamed);

}  // namespace tilegrad::train
