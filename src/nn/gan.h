// SPDX-License-Identifier: Apache-2.0
// A critic of images, and what it is trained by.
#pragma once

#include <vector>

#include "nn/layers.h"

namespace tilegrad::nn {

// PatchGAN (Isola et al. 2017): `halvings` 4x4 convolutions of stride 2, leaky ReLU of 0.2 after
// each, the channels doubling from `base`, then a 3x3 one to one number for each patch. For the
// gradient penalty no batch norm: a sample's score must depend on that sample alone.
struct CriticShape {
  std::int64_t in = 3, base = 64;
  int halvings = 4;
  PadMode padding_mode = PadMode::kZero;  // kCircular for textures that wrap around
};
class Critic : public Module {
 public:
  Critic(Context& context, const CriticShape& shape, Rng& rng);
  // The output of every level, for feature matching; the last is the map of scores [n, 1, h, w].
  std::vector<Var> Features(const Var& x, Mode mode);
  Var Forward(const Var& x, Mode mode) override;  // the map of scores
  void Visit(const std::string& prefix, ModuleVisitor& visitor) override;

 private:
  std::vector<Sequential> levels_;
};

// A critic at x [n, ..]: the mean over samples of its mean score, and the mean over samples of
// (|d mean score / d x| - 1)^2, one norm for each sample (Gulrajani et al. 2017, the paper's
// equation 15). Both can be differentiated by the critic's weights, not by x.
struct PenalisedScore {
  Var score, penalty;  // scalars
};
PenalisedScore ScoreWithPenalty(Module& critic, const Var& x);
Var GradientPenalty(Module& critic, const Var& x);  // the second of the two

}  // namespace tilegrad::nn
