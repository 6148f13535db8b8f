// SPDX-License-Identifier: Apache-2.0
#include "nn/layers.h"

#include "nn/init.h"
#include "nn/named_tensors.h"
#include "nn/ops/matmul.h"
#include "nn/ops/pointwise.h"
#include "nn/ops/shape.h"

namespace tilegrad::nn {
namespace {

// A visitor of two callables: parameter(name, Var&), buffer(name, Tensor&).
template <class P, class B>
class VisitWith : public ModuleVisitor {
 public:
  VisitWith(P parameter, B buffer) : parameter_(parameter), buffer_(buffer) {}
  void Parameter(const std::string& name, Var& value) override { parameter_(name, value); }
  void Buffer(const std::string& name, Tensor& value) override { buffer_(name, value); }

 private:
  P parameter_;
  B buffer_;
};

Var Initialised(Context& context, const Shape& shape, Rng& rng, std::int64_t fan_in) {
  Tensor tensor = context.Empty(shape);
  FillDefault(tensor, rng, fan_in);
  return Parameter(context, std::move(tensor));
}

}  // namespace

std::vector<NamedVar> Parameters(Module& module) {
  std::vector<NamedVar> result;
  VisitWith visitor(
      [&](const std::string& name, Var& v) {
        result.push_back({name, v});
      },
      [](const std::string&, Tensor&) {});
  module.Visit("", visitor);
  return result;
}

std::vector<NamedTensor> State(Module& module) {
  std::vector<NamedTensor> result;
  VisitWith visitor(
      [&](const std::string& name, Var& v) {
        result.push_back({name, v.value()});
      },
      [&](const std::string& name, Tensor& t) {
        result.push_back({name, t});
      });
  module.Visit("", visitor);
  return result;
}

std::vector<NamedTensor> Buffers(Module& module) {
  std::vector<NamedTensor> result;
  VisitWith visitor([](const std::string&, Var&) {},
                    [&](const std::string& name, Tensor& t) {
                      result.push_back({name, t});
                    });
  module.Visit("", visitor);
  return result;
}

std::int64_t CountParameters(Module& module) {
  std::int64_t count = 0;
  for (const NamedVar& p : Parameters(module)) count += p.value.shape().elements();
  return count;
}

Status LoadState(Module& module, const std::vector<NamedTensor>& state) {
  return CopyByName(state, State(module));
}

LinearLayer::LinearLayer(Context& context, const LinearShape& shape, Rng& rng)
    : weight(Initialised(context, {shape.out, shape.in}, rng, shape.in)) {
  if (shape.bias) bias = Initialised(context, {shape.out}, rng, shape.in);
}

Var LinearLayer::Forward(const Var& x, Mode) { return Linear(x, weight, bias); }

void LinearLayer::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  visitor.Parameter(prefix + "weight", weight);
  if (bias.valid()) visitor.Parameter(prefix + "bias", bias);
}

Conv2dLayer::Conv2dLayer(Context& context, const ConvShape& shape, Rng& rng)
    : options_(shape.options) {
  const std::int64_t fan_in = shape.in * shape.kernel * shape.kernel;
  weight = Initialised(context, {shape.out, shape.in, shape.kernel, shape.kernel}, rng, fan_in);
  if (shape.bias) bias = Initialised(context, {shape.out}, rng, fan_in);
}

void Conv2dLayer::Visit(const std::string& prefix, ModuleVisitor& visitor) {
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
    return BatchNormEval(x, weight, bias, {running_mean, running_variance}, options_);
  }
  const BatchNormResult batch = BatchNormTrain(x, weight, bias, options_);
  if (batch.y.valid()) Track(batch, x.shape().elements() / weight.shape().elements());
  return batch.y;
}

void BatchNorm::Track(const BatchNormResult& batch, std::int64_t count) {
  const auto n = static_cast<double>(count);
  const double unbiased = n / (n - 1.0);
  WithFloatType(running_mean.dtype(), [&]<class T>(T) {
    const auto track = [](T& running, T value, double factor) {
      running = static_cast<T>((1.0 - kMomentum) * static_cast<double>(running) +
                               kMomentum * factor * static_cast<double>(value));
    };
    for (std::size_t c = 0; c < running_mean.elements(); ++c) {
      track(running_mean.data<T>()[c], batch.mean.data<T>()[c], 1.0);
      track(running_variance.data<T>()[c], batch.variance.data<T>()[c], unbiased);
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

}  // namespace tilegrad::nn
