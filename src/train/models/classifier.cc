// SPDX-License-Identifier: Apache-2.0
#include "train/models/classifier.h"

#include <algorithm>
#include <string>

#include "base/rng.h"
#include "nn/ops.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kClassifierWeightStream = 0x636c617373696679;
constexpr int kColorChannels = 3;

}  // namespace

ClassifierNetwork::ClassifierNetwork(nn::Context& context, const ClassifierConfig& config,
                                     std::int64_t classes, std::uint64_t seed) {
  Rng rng(seed, kClassifierWeightStream);
  std::int64_t in = kColorChannels, out = std::min(config.channels, config.most);
  for (std::int64_t i = 0; i < config.levels; ++i) {
    nn::Sequential& level = levels_.emplace_back();
    const nn::ConvShape same{
        .in = in, .out = out, .kernel = 3, .options = {.padding = 1}, .bias = false};
    level.Add<nn::Conv2dLayer>("conv", context, same, rng);
    level.Add<nn::BatchNorm>("norm", context, out);
    in = out;
    out = std::min(2 * out, config.most);
  }
  head_.Add<nn::LinearLayer>("fc", context, nn::LinearShape{.in = in, .out = classes}, rng);
}

std::vector<nn::Var> ClassifierNetwork::Levels(const nn::Var& images, nn::Mode mode) {
  std::vector<nn::Var> out;
  for (nn::Sequential& level : levels_) {
    const nn::Var x =
        out.empty() ? images : nn::AvgPool2d(nn::Relu(out.back()), {.kernel = 2, .stride = 2});
    out.push_back(level.Forward(x, mode));
  }
  return out;
}

nn::Var ClassifierNetwork::Forward(const nn::Var& images, nn::Mode mode) {
  return head_.Forward(nn::Mean(nn::Relu(Levels(images, mode).back()), {2, 3}), mode);
}

void ClassifierNetwork::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  for (std::size_t i = 0; i < levels_.size(); ++i)
    levels_[i].Visit(prefix + "level" + std::to_string(i) + ".", visitor);
  head_.Visit(prefix + "head.", visitor);
}

}  // namespace tilegrad::train
