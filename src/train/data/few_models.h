// SPDX-License-Identifier: Apache-2.0
// Datasets so small that a network only memorises them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "train/data/dataset.h"

namespace tilegrad::train {

// Fewer training shapes (CountShapes) than this are too few; streaming (data/stream) makes variants
// of each, so that fewer suffice.
inline constexpr std::size_t kFewShapes = 50, kFewStreamedShapes = 20;

// Advice for the user, if the training models among these are too few.
std::optional<std::string> AdviceOnFewModels(const std::vector<ModelInfo>& models, bool streamed);

}  // namespace tilegrad::train
