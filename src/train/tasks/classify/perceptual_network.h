// SPDX-License-Identifier: Apache-2.0
// The networks of perceptual losses, by name and file.
#pragma once

#include "base/file.h"
#include "nn/context.h"
#include "train/losses/l1.h"

namespace tilegrad::train {

struct PerceptualSource {
  // "classify": a run folder, or one checkpoint, of task.kind = "classify". "vgg16": the user's
  // safetensors file with torchvision's tensor names (nn::Vgg16).
  std::string kind = "classify";
  Path file;
  // For "classify": skips the levels before this one, but always keeps one. At the full and half
  // size of the picture, features compare little more than pixels: docs/gan.md.
  int first_level = 2;
};

// Its features in the context's dtype, with frozen weights. Errors name the file and what is wrong
// with it.
Result<FeatureFunction> LoadPerceptualNetwork(nn::Context& context, const PerceptualSource& source);
// The file with its weights.
Result<Path> PerceptualWeights(nn::Context& context, const PerceptualSource& source);

}  // namespace tilegrad::train
