// SPDX-License-Identifier: Apache-2.0
#include "nn/gan.h"

#include <string>
#include <utility>

#include "nn/ops.h"

namespace tilegrad::nn {
Critic::Critic(Context& context, const CriticShape& shape, Rng& rng) {
  std::int64_t in = shape.in, out = shape.base;
  for (int i = 0; i < shape.halvings; ++i) {
    AddConvBlock(
        levels_.emplace_back(), "down", context,
        {.conv = {.in = in, .out = out, .kernel = 4, .options = {2, 1, shape.padding_mode}},
         .activation = &LeakyRelu02},
        rng);
    in = out;
    out *= 2;
  }
  AddConvBlock(levels_.emplace_back(), "score", context,
               {.conv = {.in = in, .out = 1, .options = {1, 1, shape.padding_mode}}}, rng);
}

Var Critic::Forward(const Var& x, Mode mode) {
  Var y = x;
  for (Sequential& level : levels_) y = level.Forward(y, mode);
  return y;
}

std::vector<Var> Critic::Features(const Var& x, Mode mode) {
  std::vector<Var> features;
  for (Sequential& level : levels_) {
    features.push_back(level.Forward(features.empty() ? x : features.back(), mode));
  }
  return features;
}

void Critic::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    levels_[i].Visit(prefix + "level" + std::to_string(i + 1) + ".", visitor);
  }
}

PenalisedScore ScoreWithPenalty(Module& critic, const Var& x) {
  if (!x.valid() || x.shape().rank() < 1) return {Invalid({&x}), Invalid({&x})};
  // sqrt has no finite gradient at 0, the value for a constant critic.
  constexpr double kTiny = 1e-12;
  const std::int64_t samples = x.shape()[0];
  const Var at = Parameter(x.context(), x.value());
  const Var scores = Mean(Reshape(critic.Forward(at, Mode::kTrain), {samples, -1}), {1});
  const Var d_x = Grad(Sum(scores), {at}, {.create_graph = true})[0];
  const Var norm = Sqrt(Sum(Square(Reshape(d_x, {samples, -1})), {1}) + kTiny);
  return {Mean(scores), Mean(Square(norm - 1.0))};
}

Var GradientPenalty(Module& critic, const Var& x) { return ScoreWithPenalty(critic, x).penalty; }

}  // namespace tilegrad::nn
