// SPDX-License-Identifier: Apache-2.0
// Files of a run that say what it was trained on. Files of weights (checkpoint.h: WriteWeights)
// carry them as tensors of bytes: predict warns of other pictures, eval refuses models trained on.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "nn/layers.h"

namespace tilegrad::train {

struct RunFile {
  Bytes bytes;
  std::string place;  // for messages: its path, or "cars.safetensors: thumbnails.npz"
};

// The file of that name of a run, which is a folder, a checkpoint or a file of weights; none where
// it has none.
Result<std::optional<RunFile>> ReadRunFile(const Path& run, const std::string& name);

// All that the run has of them, as tensors U8 [bytes] "file.NAME".
Result<std::vector<nn::NamedTensor>> CarriedFiles(nn::Context& context, const Path& run);

}  // namespace tilegrad::train
