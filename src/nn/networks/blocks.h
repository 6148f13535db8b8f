// SPDX-License-Identifier: Apache-2.0
// What the networks of this folder are put together from.
#pragma once

#include <string>

#include "base/function_ref.h"
#include "nn/layers.h"

namespace tilegrad::nn {

enum class Norm { kNone, kBatch, kInstance, kLayer };

// Adds convolution, norm and activation to `net` as "<name>.conv", "<name>.norm", "<name>.act". A
// convolution that a norm follows has no bias: the norm would take it out again.
struct ConvBlock {
  ConvShape conv;
  bool transposed = false;
  Norm norm = Norm::kNone;
  Activation::Function activation = nullptr;
};
void AddConvBlock(Sequential& net, const std::string& name, Context& context,
                  const ConvBlock& block, Rng& rng);
void AddNorm(Sequential& net, const std::string& name, Context& context, Norm norm,
             std::int64_t channels);

LinearLayer& AddLinear(Sequential& net, const std::string& name, Context& context, std::int64_t in,
                       std::int64_t out, Rng& rng);

// "name": x + two 3x3 convolutions of x, the first followed by norm and ReLU, the second by norm;
// where in and out differ, x goes through a 1x1 convolution.
struct ResidualShape {
  std::int64_t in = 0, out = 0;
  Norm norm = Norm::kInstance;
  PadMode padding_mode = PadMode::kZero;
};
void AddResidualBlock(Sequential& net, const std::string& name, Context& context,
                      const ResidualShape& shape, Rng& rng);

Var LeakyRelu02(const Var& x);  // LeakyRelu of slope 0.2, as an Activation

// Calls fill on the value of each parameter of rank 2 and more: the weights, not biases and norms.
void FillWeights(Module& module, FunctionRef<void(Tensor& weight)> fill);

}  // namespace tilegrad::nn
