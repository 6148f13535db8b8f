// SPDX-License-Identifier: Apache-2.0
#include "nn/networks/features.h"

#include <array>

#include "base/error.h"
#include "nn/ops/conv.h"
#include "nn/ops/pointwise.h"
#include "nn/ops/pool.h"
#include "nn/ops/reduce.h"

namespace tilegrad::nn {
namespace {

// One entry of torchvision's "features" that holds weights or pools; rectifiers follow
// convolutions.
struct Step {
  enum Kind { kConvolution, kFire, kPool } kind;
  int index = 0;   // in "features"
  int stride = 1;  // of a pool: its stride
  int padding = 0;
  int window = 0;  // of a pool
  bool tap = false;
};

constexpr Step Conv(int index, int stride, int padding, bool tap) {
  return {Step::kConvolution, index, stride, padding, 0, tap};
}
constexpr Step Fire(int index, bool tap) { return {Step::kFire, index, 1, 0, 0, tap}; }
constexpr Step Pool(int window) { return {Step::kPool, 0, 2, 0, window, false}; }

constexpr Step kAlexNet[] = {Conv(0, 4, 2, true), Pool(3),
                             Conv(3, 1, 2, true), Pool(3),
                             Conv(6, 1, 1, true), Conv(8, 1, 1, true),
                             Conv(10, 1, 1, true)};
constexpr Step kVgg16[] = {Conv(0, 1, 1, false),
                           Conv(2, 1, 1, true),
                           Pool(2),
                           Conv(5, 1, 1, false),
                           Conv(7, 1, 1, true),
                           Pool(2),
                           Conv(10, 1, 1, false),
                           Conv(12, 1, 1, false),
                           Conv(14, 1, 1, true),
                           Pool(2),
                           Conv(17, 1, 1, false),
                           Conv(19, 1, 1, false),
                           Conv(21, 1, 1, true),
                           Pool(2),
                           Conv(24, 1, 1, false),
                           Conv(26, 1, 1, false),
                           Conv(28, 1, 1, true)};
constexpr Step kSqueezeNet[] = {
    Conv(0, 2, 0, true), Pool(3), Fire(3, false), Fire(4, true),  Pool(3),        Fire(6, false),
    Fire(7, true),       Pool(3), Fire(9, true),  Fire(10, true), Fire(11, true), Fire(12, true)};

std::span<const Step> StepsOf(FeatureKind kind) {
  switch (kind) {
    case FeatureKind::kAlexNet:
      return kAlexNet;
    case FeatureKind::kVgg16:
      return kVgg16;
    case FeatureKind::kSqueezeNet:
      return kSqueezeNet;
  }
  return {};
}

// In the context's dtype.
Tensor Converted(Context& context, const Tensor& from) {
  return WithFloatType(from.dtype(),
                       [&]<class T>(T) { return context.From(from.shape(), from.span<T>()); });
}

Result<Tensor> FindFloat(const std::vector<NamedTensor>& weights, const std::string& name) {
  const Tensor* tensor = Find(weights, name);
  if (tensor == nullptr) return NotFound("feature network: no tensor \"{}\"", name);
  if (tensor->dtype() == DType::kF32 || tensor->dtype() == DType::kF64) return *tensor;
  return InvalidArgument("feature network: \"{}\" is {}, F32 or F64 is needed", name,
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
  if (weight.shape().rank() != 4 || weight.shape()[1] != in) {
    return InvalidArgument("feature network: \"{}.weight\" has shape {}, [out, {}, h, w] is needed",
                           name, weight.shape().ToString(), in);
  }
  if (bias.shape() == Shape{weight.shape()[0]}) return Loaded{weight, bias};
  return InvalidArgument("feature network: \"{}.bias\" has shape {} beside a weight of {}", name,
                         bias.shape().ToString(), weight.shape().ToString());
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

Result<FeatureNetwork> FeatureNetwork::Load(Context& context, FeatureKind kind,
                                            const std::vector<NamedTensor>& weights) {
  FeatureNetwork network(kind);
  std::int64_t channels = 3;
  // Returns the channels that come out.
  const auto load = [&](const std::string& name, std::int64_t in) -> Result<std::int64_t> {
    TILEGRAD_ASSIGN(const Loaded loaded, LoadConvolution(weights, name, in));
    network.convolutions_.push_back({Constant(context, Converted(context, loaded.weight)),
                                     Constant(context, Converted(context, loaded.bias))});
    return loaded.weight.shape()[0];
  };
  for (const Step& step : StepsOf(kind)) {
    const std::string name = "features." + std::to_string(step.index);
    if (step.kind == Step::kConvolution) {
      TILEGRAD_ASSIGN(channels, load(name, channels));
    } else if (step.kind == Step::kFire) {
      TILEGRAD_ASSIGN(const std::int64_t squeezed, load(name + ".squeeze", channels));
      TILEGRAD_ASSIGN(const std::int64_t narrow, load(name + ".expand1x1", squeezed));
      TILEGRAD_ASSIGN(const std::int64_t wide, load(name + ".expand3x3", squeezed));
      channels = narrow + wide;
    }
  }
  return network;
}

// Iandola et al. 2016: a 1x1 convolution, then 1x1 and 3x3 ones side by side.
Var FeatureNetwork::Fire(const Var& x, std::size_t first) const {
  const auto apply = [&](std::size_t i, const Var& from, int padding) {
    const Convolution& c = convolutions_[first + i];
    return Relu(Conv2d(from, c.weight, c.bias, {.padding = padding}));
  };
  const Var squeezed = apply(0, x, 0);
  return Concat({apply(1, squeezed, 0), apply(2, squeezed, 1)}, 1);
}

std::vector<Var> FeatureNetwork::Features(const Var& x) const {
  std::vector<Var> taps;
  Var y = x.valid() ? Standardised(x) : x;
  std::size_t next = 0;
  for (const Step& step : StepsOf(kind_)) {
    switch (step.kind) {
      case Step::kConvolution:
        y = Relu(Conv2d(y, convolutions_[next].weight, convolutions_[next].bias,
                        {.stride = step.stride, .padding = step.padding}));
        next += 1;
        break;
      case Step::kFire:
        y = Fire(y, next);
        next += 3;
        break;
      case Step::kPool:
        y = MaxPool2d(y, {.kernel = step.window, .stride = step.stride},
                      kind_ == FeatureKind::kSqueezeNet ? Rounding::kUp : Rounding::kDown);
        break;
    }
    if (step.tap) taps.push_back(y);
  }
  return taps;
}

Var PerceptualL1(std::span<const Var> a, std::span<const Var> b) {
  if (a.size() != b.size()) {
    return Fail(a.empty() ? b[0] : a[0],
                InvalidArgument("perceptual loss: {} layers beside {}", a.size(), b.size()));
  }
  Var sum;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Var layer = Mean(Abs(Sub(a[i], b[i])));
    sum = i == 0 ? layer : Add(sum, layer);
  }
  return sum;
}

}  // namespace tilegrad::nn
