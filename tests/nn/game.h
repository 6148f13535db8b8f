// SPDX-License-Identifier: Apache-2.0
// An adversarial game and U-Nets, small, for tests of whole training steps.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "nn/nn.h"
#include "support/expect.h"

namespace tilegrad::nn {

// Every operation that a network of this library uses is in its step, and every kernel: the wide
// networks have channels enough for kernels/conv2d/winograd.h.
class Game {
 public:
  explicit Game(const Workers& workers)
      : context_(workers),
        critic_(context_, {.base = 5, .halvings = 2, .padding_mode = PadMode::kCircular}, rng_),
        judge_(context_, {.base = 4, .halvings = 2}, rng_),
        net_(context_, {.base = 5, .most = 11, .levels = 3, .output = &Sigmoid}, rng_),
        wide_critic_(context_, {.base = 16, .halvings = 2}, rng_),
        wide_net_(context_, {.base = 16, .levels = 2}, rng_),
        adam_(context_, All(), {.learning_rate = 1e-3, .weight_decay = 1e-2}) {}

  double Step(std::uint64_t step) {
    Rng rng(3, step);
    const Var real = Random({3, 3, 16, 16}, rng);
    const Var one = Slice(real, 0, 0, 1);
    const Var painted = net_.Forward(real, Mode::kTrain);
    const Var pooled = AvgPool2d(MaxPool2d(painted, {3, 2, 1}), {2, 2});
    const Var larger = Resize(pooled, {7, 5}, ResizeMode::kBilinear);
    const Var labels = Reshape(Softmax(Reshape(larger, {3, -1}), 1), larger.shape());
    const Var loss = Mean(critic_.Forward(painted, Mode::kTrain)) + GradientPenalty(critic_, real) +
                     Mean(Softplus(judge_.Forward(painted, Mode::kTrain))) + Mean(Square(labels)) +
                     Mean(Abs(painted - real)) + GradientPenalty(wide_critic_, one) +
                     Mean(Abs(wide_net_.Forward(one, Mode::kTrain) - one));
    const auto gradients = Grad(loss, adam_.parameters());
    Ok(adam_.Step(gradients));
    return loss.item();
  }

  Bytes Encoded() { return EncodeSafetensors({adam_.State(), {}}).value(); }
  MemoryStats memory() const { return context_.memory().stats(); }

 private:
  Var Random(const Shape& shape, Rng& rng) {
    Tensor t = context_.Empty(shape);
    FillUniform(t, rng, 0, 1);
    return Constant(context_, t);
  }
  std::vector<NamedVar> All() {
    std::vector<NamedVar> all;
    int number = 0;
    for (Module* module :
         std::initializer_list<Module*>{&critic_, &judge_, &net_, &wide_critic_, &wide_net_}) {
      const std::string prefix = std::to_string(++number) + ".";
      for (const NamedVar& p : Parameters(*module)) all.push_back({prefix + p.name, p.value});
    }
    return all;
  }

  Context context_;
  Rng rng_{4};
  Critic critic_, judge_;
  UNet net_;
  Critic wide_critic_;
  UNet wide_net_;
  Adam adam_;
};

}  // namespace tilegrad::nn
