// SPDX-License-Identifier: Apache-2.0
// The networks that a perceptual loss can look through, by name and file.
#pragma once

#include "base/file.h"
#include "nn/context.h"
#include "train/losses/feature_l1.h"

namespace tilegrad::train {

struct PerceptualSource {
  // "classify": a run folder, or one checkpoint, of task.kind = "classify". "vgg16": a safetensors
  // file of the user's with torchvision's names (nn::Vgg16).
  std::string kind = "classify";
  Path file;
  // Of "classify": the levels before this one are left out, as far as one remains. At the full and
  // half size of the picture the network compares little more than pixels: docs/gan.md.
  int first_level = 2;
};

// Its features in the context's dtype; its weights stay as they are. Errors name the file and what
// is wrong with it.
Result<FeatureFunction> LoadPerceptualNetwork(nn::Context& context, const PerceptualSource& source);
// The file that its weights are in.
Result<Path> PerceptualWeights(nn::Context& context, const PerceptualSource& source);

}  // namespace tilegrad::train
