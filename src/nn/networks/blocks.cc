// SPDX-License-Identifier: Apache-2.0
#include "nn/networks/blocks.h"

#include "nn/ops/pointwise.h"

namespace tilegrad::nn {

Var LeakyRelu02(const Var& x) { return LeakyRelu(x, 0.2); }

void AddNorm(Sequential& net, const std::string& name, Context& context, Norm norm,
             std::int64_t channels) {
  switch (norm) {
    case Norm::kNone:
      return;
    case Norm::kBatch:
      net.Add<BatchNorm>(name, context, channels);
      return;
    case Norm::kInstance:
      net.Add<GroupNormLayer>(name, context, channels, channels);
      return;
    case Norm::kLayer:
      net.Add<GroupNormLayer>(name, context, channels, 1);
      return;
  }
}

void AddConvBlock(Sequential& net, const std::string& name, Context& context,
                  const ConvBlock& block, Rng& rng) {
  ConvShape shape = block.conv;
  shape.bias = shape.bias && block.norm == Norm::kNone;
  if (block.transposed) {
    net.Add<ConvTranspose2dLayer>(name + ".conv", context, shape, rng);
  } else {
    net.Add<Conv2dLayer>(name + ".conv", context, shape, rng);
  }
  if (block.norm == Norm::kBatch && block.activation == &Relu) {
    net.Add<BatchNorm>(name + ".norm", context, shape.out, BatchNormOptions{.relu = true});
    return;
  }
  AddNorm(net, name + ".norm", context, block.norm, shape.out);
  if (block.activation != nullptr) net.Add<Activation>(name + ".act", block.activation);
}

LinearLayer& AddLinear(Sequential& net, const std::string& name, Context& context, std::int64_t in,
                       std::int64_t out, Rng& rng) {
  return net.Add<LinearLayer>(name, context, LinearShape{.in = in, .out = out}, rng);
}

void AddResidualBlock(Sequential& net, const std::string& name, Context& context,
                      const ResidualShape& shape, Rng& rng) {
  auto& block = net.Add<Residual>(name);
  const ConvOptions same{1, 1, shape.padding_mode};
  AddConvBlock(block.body, "1", context,
               {.conv = {.in = shape.in, .out = shape.out, .options = same},
                .norm = shape.norm,
                .activation = &Relu},
               rng);
  AddConvBlock(block.body, "2", context,
               {.conv = {.in = shape.out, .out = shape.out, .options = same}, .norm = shape.norm},
               rng);
  if (shape.in == shape.out) return;
  block.shortcut.Add<Conv2dLayer>(
      "conv", context, ConvShape{.in = shape.in, .out = shape.out, .kernel = 1, .bias = false},
      rng);
}

void FillWeights(Module& module, FunctionRef<void(Tensor& weight)> fill) {
  for (NamedVar& p : Parameters(module)) {
    if (p.value.shape().rank() >= 2) fill(p.value.value());
  }
}

}  // namespace tilegrad::nn
