// SPDX-License-Identifier: Apache-2.0
#include "nn/networks/gan.h"

#include <string>
#include <utility>

#include "nn/init.h"
#include "nn/ops/pointwise.h"
#include "nn/ops/reduce.h"

namespace tilegrad::nn {
namespace {

constexpr ConvOptions kDouble = {.stride = 2, .padding = 1};  // of a transposed 4x4 kernel
constexpr std::int64_t kRoot = 4;                             // pixels a side

}  // namespace

Generator::Generator(Context& context, const GeneratorShape& shape, Rng& rng)
    : channels_(shape.base << (shape.doublings - 1)) {
  root_.Add<LinearLayer>("fc", context,
                         LinearShape{.in = shape.noise, .out = channels_ * kRoot * kRoot}, rng);
  AddNorm(net_, "norm", context, shape.norm, channels_);
  net_.Add<Activation>("act", &Relu);
  std::int64_t channels = channels_;
  for (int i = 1; i <= shape.doublings; ++i) {
    const bool last = i == shape.doublings;
    AddConvBlock(net_, "up" + std::to_string(i), context,
                 {.conv = {.in = channels,
                           .out = last ? shape.out : channels / 2,
                           .kernel = 4,
                           .options = kDouble},
                  .transposed = true,
                  .norm = last ? Norm::kNone : shape.norm,
                  .activation = last ? &Tanh : &Relu},
                 rng);
    channels /= 2;
  }
  FillWeights(*this, [&](Tensor& weight) { FillNormal(weight, rng, 0.02); });
}

Var Generator::Forward(const Var& noise, Mode mode) {
  const Var root = root_.Forward(noise, mode);
  return net_.Forward(Reshape(root, {-1, channels_, kRoot, kRoot}), mode);
}

void Generator::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  root_.Visit(prefix, visitor);
  net_.Visit(prefix, visitor);
}

Critic::Critic(Context& context, const CriticShape& shape, Rng& rng) {
  std::int64_t in = shape.in, out = shape.base;
  for (int i = 0; i < shape.halvings; ++i) {
    AddConvBlock(levels_.emplace_back(), "down", context,
                 {.conv = {.in = in,
                           .out = out,
                           .kernel = 4,
                           .options = {2, 1, shape.padding_mode},
                           .spectral = shape.spectral},
                  .norm = i == 0 ? Norm::kNone : shape.norm,
                  .activation = &LeakyRelu02},
                 rng);
    in = out, out *= 2;
  }
  AddConvBlock(levels_.emplace_back(), "score", context,
               {.conv = {.in = in,
                         .out = 1,
                         .options = {1, 1, shape.padding_mode},
                         .spectral = shape.spectral}},
               rng);
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
