// SPDX-License-Identifier: Apache-2.0
#include "nn/networks/blocks.h"

#include "nn/ops/pointwise.h"

namespace tilegrad::nn {

Var LeakyRelu02(const Var& x) { return LeakyRelu(x, 0.2); }

void AddConvBlock(Sequential& net, const std::string& name, Context& context,
                  const ConvBlock& block, Rng& rng) {
  ConvShape shape = block.conv;
  shape.bias = shape.bias && !block.norm;
  net.Add<Conv2dLayer>(name + ".conv", context, shape, rng);
  const bool fused = block.norm && block.activation == &Relu;
  if (block.norm) {
    net.Add<BatchNorm>(name + ".norm", context, shape.out, BatchNormOptions{.relu = fused});
  }
  if (block.activation != nullptr && !fused) net.Add<Activation>(name + ".act", block.activation);
}

LinearLayer& AddLinear(Sequential& net, const std::string& name, Context& context, std::int64_t in,
                       std::int64_t out, Rng& rng) {
  return net.Add<LinearLayer>(name, context, LinearShape{.in = in, .out = out}, rng);
}

void AddResidualBlock(Sequential& net, const std::string& name, Context& context,
                      std::int64_t channels, Rng& rng) {
  Sequential& body = net.Add<Residual>(name).body;
  const ConvShape conv{.in = channels, .out = channels, .options = {.padding = 1}};
  AddConvBlock(body, "1", context, {.conv = conv, .norm = true, .activation = &Relu}, rng);
  AddConvBlock(body, "2", context, {.conv = conv, .norm = true}, rng);
}

}  // namespace tilegrad::nn
