// SPDX-License-Identifier: Apache-2.0
#include "nn/layers.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::nn {
namespace {

// Everything that a module holds.
struct Contents : ModuleVisitor {
  explicit Contents(Module& module) { module.Visit("", *this); }
  void Parameter(const std::string& name, Var& value) override {
    parameters.push_back({name, value});
    state.push_back({name, value.value()});
  }
  void Buffer(const std::string& name, Tensor& value) override {
    buffers.push_back({name, value});
    state.push_back({name, value});
  }

  std::vector<NamedVar> parameters;
  std::vector<NamedTensor> state, buffers;
};

Var Initialised(Context& context, const Shape& shape, Rng& rng, std::int64_t fan_in) {
  Tensor tensor = context.Empty(shape);
  FillDefault(tensor, rng, fan_in);
  return Parameter(context, std::move(tensor));
}

template <class Draw>
void FillBy(Tensor& tensor, const Draw& draw) {
  WithFloatType(tensor.dtype(), [&]<class T>(T) {
    std::generate_n(tensor.data<T>(), tensor.elements(), [&] { return static_cast<T>(draw()); });
  });
}

}  // namespace

std::vector<NamedVar> Parameters(Module& module) { return Contents(module).parameters; }
std::vector<NamedTensor> State(Module& module) { return Contents(module).state; }
std::vector<NamedTensor> Buffers(Module& module) { return Contents(module).buffers; }

std::int64_t CountParameters(Module& module) {
  std::int64_t count = 0;
  for (const NamedVar& p : Parameters(module)) count += p.value.shape().elements();
  return count;
}

Status LoadState(Module& module, const std::vector<NamedTensor>& state) {
  return CopyByName(state, State(module));
}

LinearLayer::LinearLayer(Context& context, const LinearShape& shape, Rng& rng) {
  weight = Initialised(context, {shape.out, shape.in}, rng, shape.in);
  if (shape.bias) bias = Initialised(context, {shape.out}, rng, shape.in);
}

Var LinearLayer::Forward(const Var& x, Mode) { return Linear(x, weight, bias); }

Conv2dLayer::Conv2dLayer(Context& context, const ConvShape& shape, Rng& rng)
    : options_(shape.options) {
  const std::int64_t fan_in = shape.in * shape.kernel * shape.kernel;
  weight = Initialised(context, {shape.out, shape.in, shape.kernel, shape.kernel}, rng, fan_in);
  if (shape.bias) bias = Initialised(context, {shape.out}, rng, fan_in);
}

void WeightedLayer::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  visitor.Parameter(prefix + "weight", weight);
  if (bias.valid()) visitor.Parameter(prefix + "bias", bias);
}

Var Conv2dLayer::Forward(const Var& x, Mode) { return Conv2d(x, weight, bias, options_); }

BatchNorm::BatchNorm(Context& context, std::int64_t channels, const BatchNormOptions& options)
    : weight(Parameter(context, context.Full({channels}, 1.0))),
      bias(Parameter(context, context.Zeros({channels}))),
      running_mean(context.Zeros({channels})),
      running_variance(context.Full({channels}, 1.0)),
      options_(options) {}

Var BatchNorm::Forward(const Var& x, Mode mode) {
  if (mode == Mode::kEval) {
    const Context& context = weight.context();
    return BatchNormEval(x, weight, bias,
                         {context.InLane(running_mean), context.InLane(running_variance)},
                         options_);
  }
  const BatchNormResult batch = BatchNormTrain(x, weight, bias, options_);
  if (batch.y.valid()) Track(batch, x.shape().elements() / weight.shape().elements());
  return batch.y;
}

void BatchNorm::Track(const BatchNormResult& batch, std::int64_t count) {
  const auto n = static_cast<double>(count);
  const double unbiased = n / (n - 1.0);
  Tensor means = weight.context().InLane(running_mean);
  Tensor variances = weight.context().InLane(running_variance);
  WithFloatType(running_mean.dtype(), [&]<class T>(T) {
    const auto track = [](T& running, T value, double factor) {
      running = static_cast<T>((1.0 - kMomentum) * static_cast<double>(running) +
                               kMomentum * factor * static_cast<double>(value));
    };
    for (std::size_t c = 0; c < means.elements(); ++c) {
      track(means.data<T>()[c], batch.mean.data<T>()[c], 1.0);
      track(variances.data<T>()[c], batch.variance.data<T>()[c], unbiased);
    }
  });
}

void BatchNorm::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  visitor.Parameter(prefix + "weight", weight);
  visitor.Parameter(prefix + "bias", bias);
  visitor.Buffer(prefix + "running_mean", running_mean);
  visitor.Buffer(prefix + "running_var", running_variance);
}

Var Flatten::Forward(const Var& x, Mode) {
  if (!x.valid() || x.shape().rank() < 1) return x;
  return Reshape(x, {x.shape()[0], x.shape().Product(1, x.shape().rank())});
}

Var Sequential::Forward(const Var& x, Mode mode) {
  Var y = x;
  for (const auto& [name, module] : children_) y = module->Forward(y, mode);
  return y;
}

Var Residual::Forward(const Var& x, Mode mode) { return Add(x, body.Forward(x, mode)); }

void Residual::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  body.Visit(prefix + "body.", visitor);
}

void Sequential::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  for (const auto& [name, module] : children_) module->Visit(prefix + name + ".", visitor);
}

void FillConstant(Tensor& tensor, double value) {
  FillBy(tensor, [value] { return value; });
}

void FillNormal(Tensor& tensor, Rng& rng, double deviation) {
  FillBy(tensor, [&] { return deviation * rng.Normal(); });
}

void FillUniform(Tensor& tensor, Rng& rng, double low, double high) {
  FillBy(tensor, [&] { return rng.Uniform(low, high); });
}

void FillDefault(Tensor& tensor, Rng& rng, std::int64_t fan_in) {
  const double bound = 1.0 / std::sqrt(static_cast<double>(std::max<std::int64_t>(1, fan_in)));
  FillUniform(tensor, rng, -bound, bound);
}

Var LeakyRelu02(const Var& x) { return LeakyRelu(x, 0.2); }

void AddConvBlock(Sequential& net, const std::string& name, Context& context,
                  const ConvBlock& block, Rng& rng) {
  ConvShape shape = block.conv;
  shape.bias = shape.bias && !block.norm;
  net.Add<Conv2dLayer>(name + ".conv", context, shape, rng);
  const bool fused = block.norm && block.activation == &Relu;
  if (block.norm)
    net.Add<BatchNorm>(name + ".norm", context, shape.out, BatchNormOptions{.relu = fused});
  if (block.activation != nullptr && !fused) net.Add<Activation>(name + ".act", block.activation);
}

LinearLayer& AddLinear(Sequential& net, const std::string& name, Context& context, std::int64_t in,
                       std::int64_t out, Rng& rng) {
  return net.Add<LinearLayer>(name, context, LinearShape{.in = in, .out = out}, rng);
}

}  // namespace tilegrad::nn
