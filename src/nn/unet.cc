// SPDX-License-Identifier: Apache-2.0
#include "nn/unet.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"
#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

constexpr ConvOptions kHalve = {.stride = 2, .padding = 1};  // of a 4x4 kernel

// Checks that an image can be halved `halvings` times without a remainder.
Status CheckImage(const Var& x, std::size_t halvings) {
  const std::int64_t step = std::int64_t{1} << halvings;
  const Shape& shape = x.shape();
  if (shape.rank() == 4 && shape[2] % step == 0 && shape[3] % step == 0) return {};
  return InvalidArgument("U-Net: {} is not an image with sides a multiple of {}", shape.ToString(),
                         step);
}

// Twice the height and the width, nearest, with one pixel around it: of the other edge to the left
// and right, of the same edge above and below.
class UpsampleMap : public Module {
 public:
  Var Forward(const Var& x, Mode) override {
    if (!Usable("upsample map", {&x})) return Invalid({&x});
    return Grow(Grow(x, 3), 2);
  }
  void Visit(const std::string&, ModuleVisitor&) override {}

 private:
  static Var Grow(const Var& x, int axis) {
    const std::int64_t extent = x.shape()[axis], out = 2 * extent;
    const auto row = [&](std::int64_t i, AxisTerms& terms) {
      const std::int64_t at =
          axis == 3 ? (i - 1 + out) % out : std::clamp(i - 1, std::int64_t{0}, out - 1);
      terms.push_back({at / 2, 1.0});
    };
    return MapAxis(x, axis, MakeAxisMap(x, {extent, out + 2}, row));
  }
};

// ReLU, then a convolution at twice the size.
void AddDoubling(Sequential& net, Context& context, ConvBlock block, Rng& rng) {
  block.conv.kernel = 3;
  net.Add<Activation>("act", &Relu);
  net.Add<UpsampleMap>("resize");
  AddConvBlock(net, "up", context, block, rng);
}

}  // namespace

UNet::UNet(Context& context, const UNetShape& shape, Rng& rng) : skips_(shape.skips) {
  const int levels = shape.levels;
  const auto channels = [&](int level) {
    return std::min(shape.most, shape.base << std::min(level, 30));
  };
  const auto output = [&](std::int64_t from) {
    return ConvBlock{.conv = {.in = from, .out = shape.out}, .activation = shape.output};
  };
  for (int i = 0; i < levels; ++i) {
    Sequential down, up;
    if (i > 0) down.Add<Activation>("act", &LeakyRelu02);
    AddConvBlock(down, "down", context,
                 {.conv = {.in = i == 0 ? shape.in : channels(i - 1),
                           .out = channels(i),
                           .kernel = 4,
                           .options = kHalve},
                  .norm = i > 0 && i + 1 < levels},
                 rng);
    // Above the innermost level the decoder has the skip connection's channels beside its own.
    const std::int64_t from = i + 1 == levels || !shape.skips ? channels(i) : 2 * channels(i);
    if (i == 0 && shape.enlarge == 0) {
      AddDoubling(up, context, output(from), rng);
    } else {
      AddDoubling(up, context,
                  {.conv = {.in = from, .out = channels(std::max(0, i - 1))}, .norm = true}, rng);
    }
    down_.push_back(std::move(down));
    up_.push_back(std::move(up));
  }
  for (int k = 1; k <= shape.enlarge; ++k) {
    Sequential& grow = grow_.emplace_back();
    if (k == shape.enlarge) {
      AddDoubling(grow, context, output(channels(0)), rng);
    } else {
      AddDoubling(grow, context, {.conv = {.in = channels(0), .out = channels(0)}, .norm = true},
                  rng);
    }
  }
}

StepVector<Var> UNet::Encode(const Var& x, Mode mode) {
  const Status fits = x.valid() ? CheckImage(x, down_.size()) : Status();
  StepVector<Var> levels({fits.ok() ? x : Fail(x, fits)}, x.context().allocator<Var>());
  for (Sequential& down : down_) levels.push_back(down.Forward(levels.back(), mode));
  return levels;
}

Var UNet::Decode(const Var& code, const StepVector<Var>& levels, Mode mode) {
  Var y = code;
  for (std::size_t i = up_.size(); i-- > 0;) {
    if (skips_ && i + 1 < up_.size()) y = Concat({y, levels[i + 1]}, 1);
    y = up_[i].Forward(y, mode);
  }
  for (Sequential& grow : grow_) y = grow.Forward(y, mode);
  return y;
}

Var UNet::Forward(const Var& x, Mode mode) {
  if (!x.has_context()) return x;
  const StepVector<Var> levels = Encode(x, mode);
  return Decode(levels.back(), levels, mode);
}

void UNet::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  for (std::size_t i = 0; i < down_.size(); ++i) {
    const std::string level = prefix + "level" + std::to_string(i + 1) + ".";
    down_[i].Visit(level, visitor);
    up_[i].Visit(level, visitor);
  }
  for (std::size_t k = 0; k < grow_.size(); ++k)
    grow_[k].Visit(prefix + "grow" + std::to_string(k + 1) + ".", visitor);
}

}  // namespace tilegrad::nn
