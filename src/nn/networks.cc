// SPDX-License-Identifier: Apache-2.0
#include "nn/networks.h"

#include <algorithm>
#include <array>
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
  return InvalidArgument("U-Net: {} is not an image with sides a multiple of {}", shape, step);
}

// Doubles height and width (nearest) and pads one pixel: circular to the left and right, replicated
// above and below.
class UpsampleMap : public Module {
 public:
  Var Forward(const Var& x, Mode) override {
    if (!Usable("upsample map", {&x})) return Invalid({&x});
    return MapImage(x, Grown(x, 2), Grown(x, 3));
  }
  void Visit(const std::string&, ModuleVisitor&) override {}

 private:
  static AxisMap Grown(const Var& x, int axis) {
    const std::int64_t extent = x.shape()[axis], out = 2 * extent;
    const auto row = [&](std::int64_t i, AxisTerms& terms) {
      const std::int64_t at =
          axis == 3 ? (i - 1 + out) % out : std::clamp(i - 1, std::int64_t{0}, out - 1);
      terms.push_back({at / 2, 1.0});
    };
    return MakeAxisMap(x, {extent, out + 2}, row);
  }
};

// ReLU, then a convolution at twice the size.
void AddDoubling(Sequential& net, Context& context, ConvBlock block, Rng& rng) {
  block.conv.kernel = 3;
  net.Add<Activation>("act", &Relu);
  net.Add<UpsampleMap>("resize");
  AddConvBlock(net, "up", context, block, rng);
}

constexpr int kStages[] = {2, 2, 3, 3, 3};  // 3x3 convolutions of each; a pool between two stages

// In the context's dtype.
Tensor Converted(Context& context, const Tensor& from) {
  return WithFloatType(from.dtype(),
                       [&]<class T>(T) { return context.From(from.shape(), from.span<T>()); });
}

Result<Tensor> FindFloat(const std::vector<NamedTensor>& weights, const std::string& name) {
  const Tensor* tensor = Find(weights, name);
  if (tensor == nullptr) return NotFound("VGG16: no tensor \"{}\"", name);
  if (tensor->dtype() == DType::kF32 || tensor->dtype() == DType::kF64) return *tensor;
  return InvalidArgument("VGG16: \"{}\" is {}, F32 or F64 is needed", name,
                         NameOf(tensor->dtype()));
}

struct Loaded {
  Tensor weight, bias;
};

// "<name>.weight" [out, in, kh, kw] and "<name>.bias" [out].
Result<Loaded> LoadConvolution(const std::vector<NamedTensor>& weights, const std::string& name,
                               std::int64_t in) {
  TILEGRAD_ASSIGN(const Tensor weight, FindFloat(weights, name + ".weight"));
  TILEGRAD_ASSIGN(const Tensor bias, FindFloat(weights, name + ".bias"));
  if (weight.shape().rank() != 4 || weight.shape()[1] != in)
    return InvalidArgument("VGG16: \"{}.weight\" has shape {}, [out, {}, h, w] is needed", name,
                           weight.shape(), in);
  if (bias.shape() == Shape{weight.shape()[0]}) return Loaded{weight, bias};
  return InvalidArgument("VGG16: \"{}.bias\" has shape {} beside a weight of {}", name,
                         bias.shape(), weight.shape());
}

// (x - mean) / deviation of ImageNet.
Var Standardised(const Var& x) {
  constexpr std::array<double, 3> kMean = {0.485, 0.456, 0.406}, kDeviation = {0.229, 0.224, 0.225};
  Context& context = x.context();
  const Shape channels = {1, 3, 1, 1};
  const Var mean = Constant(context, context.From(channels, std::span<const double>(kMean)));
  const Var deviation =
      Constant(context, context.From(channels, std::span<const double>(kDeviation)));
  return Div(Sub(x, mean), deviation);
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
  for (Sequential& level : levels_)
    features.push_back(level.Forward(features.empty() ? x : features.back(), mode));
  return features;
}

void Critic::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  for (std::size_t i = 0; i < levels_.size(); ++i)
    levels_[i].Visit(prefix + "level" + std::to_string(i + 1) + ".", visitor);
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

Result<Vgg16> Vgg16::Load(Context& context, const std::vector<NamedTensor>& weights) {
  Vgg16 network;
  std::int64_t channels = 3;
  int index = 0;  // in torchvision's "features", where rectifiers and pools count, too
  for (const int convolutions : kStages) {
    for (int i = 0; i < convolutions; ++i, index += 2) {
      const std::string name = "features." + std::to_string(index);
      TILEGRAD_ASSIGN(const Loaded loaded, LoadConvolution(weights, name, channels));
      channels = loaded.weight.shape()[0];
      network.convolutions_.push_back({Constant(context, Converted(context, loaded.weight)),
                                       Constant(context, Converted(context, loaded.bias))});
    }
    ++index;
  }
  return network;
}

std::vector<Var> Vgg16::Features(const Var& x) const {
  std::vector<Var> stages;
  Var y = x.valid() ? Standardised(x) : x;
  auto convolution = convolutions_.begin();
  for (const int convolutions : kStages) {
    if (!stages.empty()) y = MaxPool2d(y, {});
    for (int i = 0; i < convolutions; ++i, ++convolution)
      y = Relu(Conv2d(y, convolution->weight, convolution->bias, {.padding = 1}));
    stages.push_back(y);
  }
  return stages;
}

Var PerceptualL1(std::span<const Var> a, std::span<const Var> b) {
  if (a.size() != b.size())
    return Fail(a.empty() ? b[0] : a[0],
                InvalidArgument("perceptual loss: {} layers beside {}", a.size(), b.size()));
  Var sum;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Var layer = Mean(Abs(Sub(a[i], b[i])));
    sum = i == 0 ? layer : Add(sum, layer);
  }
  return sum;
}

}  // namespace tilegrad::nn
