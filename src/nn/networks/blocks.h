// SPDX-License-Identifier: Apache-2.0
// What the networks of this folder are put together from.
#pragma once

#include <string>

#include "nn/layers.h"

namespace tilegrad::nn {

// Adds convolution, batch norm and activation to `net` as "<name>.conv", "<name>.norm",
// "<name>.act". A convolution that a norm follows has no bias: the norm would take it out again.
struct ConvBlock {
  ConvShape conv;
  bool norm = false;
  Activation::Function activation = nullptr;
};
void AddConvBlock(Sequential& net, const std::string& name, Context& context,
                  const ConvBlock& block, Rng& rng);

LinearLayer& AddLinear(Sequential& net, const std::string& name, Context& context, std::int64_t in,
                       std::int64_t out, Rng& rng);

// "name": x + two 3x3 convolutions of x, of as many channels, the first followed by norm and ReLU,
// the second by norm.
void AddResidualBlock(Sequential& net, const std::string& name, Context& context,
                      std::int64_t channels, Rng& rng);

Var LeakyRelu02(const Var& x);  // LeakyRelu of slope 0.2, as an Activation

}  // namespace tilegrad::nn
