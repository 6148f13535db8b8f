// SPDX-License-Identifier: Apache-2.0
#include "nn/features.h"

#include <array>

#include "base/error.h"
#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

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
  if (weight.shape().rank() != 4 || weight.shape()[1] != in) {
    return InvalidArgument("VGG16: \"{}.weight\" has shape {}, [out, {}, h, w] is needed", name,
                           weight.shape().ToString(), in);
  }
  if (bias.shape() == Shape{weight.shape()[0]}) return Loaded{weight, bias};
  return InvalidArgument("VGG16: \"{}.bias\" has shape {} beside a weight of {}", name,
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

Result<Vgg16> Vgg16::Load(Context& context, const std::vector<NamedTensor>& weights) {
  Vgg16 network;
  std::int64_t channels = 3;
  int index = 0;  // in torchvision's "features", where rectifiers and pools have one, too
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
    for (int i = 0; i < convolutions; ++i, ++convolution) {
      y = Relu(Conv2d(y, convolution->weight, convolution->bias, {.padding = 1}));
    }
    stages.push_back(y);
  }
  return stages;
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
