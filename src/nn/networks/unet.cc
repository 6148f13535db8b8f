// SPDX-License-Identifier: Apache-2.0
#include "nn/networks/unet.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "nn/ops/pointwise.h"

namespace tilegrad::nn {
namespace {

constexpr ConvOptions kHalve = {.stride = 2, .padding = 1};  // of a 4x4 kernel

}  // namespace

UNet::UNet(Context& context, const UNetShape& shape, Rng& rng) {
  const int levels = shape.levels;
  const auto channels = [&](int level) {
    return std::min(shape.most, shape.base << std::min(level, 30));
  };
  for (int i = 0; i < levels; ++i) {
    Sequential down, up;
    const Norm norm = i == 0 || i + 1 == levels ? Norm::kNone : shape.norm;
    if (i > 0) down.Add<Activation>("act", &LeakyRelu02);
    AddConvBlock(down, "down", context,
                 {.conv = {.in = i == 0 ? shape.in : channels(i - 1),
                           .out = channels(i),
                           .kernel = 4,
                           .options = kHalve},
                  .norm = norm},
                 rng);
    // Above the innermost level the way up carries the skipped channels beside its own.
    const std::int64_t from = i + 1 == levels ? channels(i) : 2 * channels(i);
    ConvBlock block{.conv = {.in = from,
                             .out = i == 0 ? shape.out : channels(i - 1),
                             .kernel = 4,
                             .options = kHalve},
                    .transposed = true,
                    .norm = i == 0 ? Norm::kNone : shape.norm,
                    .activation = i == 0 ? shape.output : nullptr};
    up.Add<Activation>("act", &Relu);
    if (shape.resize) {
      up.Add<Upsample>("resize", ResizeMode::kNearest);
      block.conv.kernel = 3, block.conv.options = {.padding = 1}, block.transposed = false;
    }
    AddConvBlock(up, "up", context, block, rng);
    down_.push_back(std::move(down));
    up_.push_back(std::move(up));
  }
}

UNet::Result UNet::Run(const Var& x, Mode mode) {
  const std::int64_t step = std::int64_t{1} << down_.size();
  if (x.valid() &&
      (x.shape().rank() != 4 || x.shape()[2] % step != 0 || x.shape()[3] % step != 0)) {
    const Var failed =
        Fail(x, InvalidArgument("U-Net: {} is not an image with sides a multiple of {}",
                                x.shape().ToString(), step));
    return {failed, failed};
  }
  std::vector<Var> levels = {x};
  for (Sequential& down : down_) levels.push_back(down.Forward(levels.back(), mode));
  Var y = levels.back();
  for (std::size_t i = up_.size(); i-- > 0;) {
    if (i + 1 < up_.size()) y = Concat({y, levels[i + 1]}, 1);
    y = up_[i].Forward(y, mode);
  }
  return {y, levels.back()};
}

void UNet::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  for (std::size_t i = 0; i < down_.size(); ++i) {
    const std::string level = prefix + "level" + std::to_string(i + 1) + ".";
    down_[i].Visit(level, visitor);
    up_[i].Visit(level, visitor);
  }
}

}  // namespace tilegrad::nn
