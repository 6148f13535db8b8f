// SPDX-License-Identifier: Apache-2.0
// The training steps that this library is measured by. pytorch_steps.py has the same ones.
#pragma once

#include <array>
#include <memory>
#include <string_view>

#include "nn/context.h"

namespace tilegrad::nn::bench {

class TrainingStep {
 public:
  virtual ~TrainingStep() = default;
  virtual Status Run() = 0;         // forward, backward, Adam
  virtual double loss() const = 0;  // of the last step
};

// "reconstruction": the network of the paper's section 5.1 (34.1 million parameters, batch 64), its
//   loss replaced by a mean of squares. 55 GFLOP.
// "critic": the critic of a WGAN with gradient penalty, channels 64 to 512, 32 images of 64 x 64:
//   three forward passes, one inner gradient, the backward pass through both. 66 GFLOP.
// "adversarial": the critic of configs/texture_adversarial.toml: channels 32 to 256, 24 images.
// "gan": the networks of a texture step of configs/gan_quick.toml, batch 16: the critic of six
// views
//   (18 channels), the critic of maps (half of 128 x 128), each with gradient penalty, and the
//   generator of maps, which learns from the second critic.
inline constexpr std::array<std::string_view, 4> kTrainingSteps = {"reconstruction", "critic",
                                                                   "adversarial", "gan"};

// One of the above; null for another name.
std::unique_ptr<TrainingStep> MakeTrainingStep(std::string_view name, Context& context);

}  // namespace tilegrad::nn::bench
