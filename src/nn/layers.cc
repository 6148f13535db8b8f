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

namespace {

// What a module takes from a state, and what is to be done afterwards.
class Loading : public ModuleVisitor {
 public:
  explicit Loading(const std::vector<NamedTensor>& state) : state_(state) {}
  void Parameter(const std::string& name, Var& value) override {
    wanted.push_back({name, value.value()});
  }
  void Buffer(const std::string& name, Tensor& value) override { wanted.push_back({name, value}); }
  void NewBuffer(const std::string& name, Tensor& value,
                 const std::function<void()>& derive) override {
    if (Find(state_, name) != nullptr) return Buffer(name, value);
    missing.push_back(derive);
  }

  std::vector<NamedTensor> wanted;
  std::vector<std::function<void()>> missing;

 private:
  const std::vector<NamedTensor>& state_;
};

}  // namespace

Status LoadState(Module& module, const std::vector<NamedTensor>& state) {
  Loading loading(state);
  module.Visit("", loading);
  TILEGRAD_TRY(CopyByName(state, std::move(loading.wanted)));
  for (const auto& derive : loading.missing) derive();
  return {};
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

namespace {

// [in, out, k, k] as [out, in, k, k], and back.
Var Swapped(const Var& weight) { return Permute(weight, {1, 0, 2, 3}); }

}  // namespace

Spectral::Spectral(const Var& weight, bool transposed, Rng& rng) : transposed_(transposed) {
  const std::int64_t out = weight.shape()[transposed ? 1 : 0];
  at_.u = weight.context().Empty({out}, weight.dtype());
  at_.v = weight.context().Empty({weight.shape().elements() / out}, weight.dtype());
  FillConstant(at_.v, 0.0);  // for a weight of zeros
  FillNormal(at_.u, rng, 1.0);
  const NoGrad off(weight.context());
  SpectralStep(ByOutput(weight), at_);
}

Var Spectral::ByOutput(const Var& weight) const { return transposed_ ? Swapped(weight) : weight; }

Var Spectral::Normalised(const Var& weight, Mode mode) {
  if (at_.u.empty()) return weight;
  const Var by_output = ByOutput(weight);
  if (mode == Mode::kTrain) SpectralStep(by_output, at_);
  // Copies: the graph recorded by this pass must not see later iterations.
  Context& context = weight.context();
  const Var normalised = SpectralNorm(by_output, {context.Copy(at_.u), context.Copy(at_.v)});
  return transposed_ ? Swapped(normalised) : normalised;
}

void Spectral::Visit(const std::string& prefix, Var& weight, ModuleVisitor& visitor) {
  if (at_.u.empty()) return;
  visitor.Buffer(prefix + "spectral_u", at_.u);
  visitor.NewBuffer(prefix + "spectral_v", at_.v, [this, &weight] {
    const NoGrad off(weight.context());
    SpectralRightVector(ByOutput(weight), at_);
  });
}

ConvLayer::ConvLayer(Context& context, const ConvShape& shape, bool transposed, Rng& rng)
    : options_(shape.options) {
  const Shape weights = {transposed ? shape.in : shape.out, transposed ? shape.out : shape.in,
                         shape.kernel, shape.kernel};
  weight = Initialised(context, weights, rng, FanIn(weights));
  if (shape.bias) bias = Initialised(context, {shape.out}, rng, FanIn(weights));
  if (shape.spectral) spectral_ = Spectral(weight, transposed, rng);
}

void ConvLayer::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  visitor.Parameter(prefix + "weight", weight);
  if (bias.valid()) visitor.Parameter(prefix + "bias", bias);
  spectral_.Visit(prefix, weight, visitor);
}

Var Conv2dLayer::Forward(const Var& x, Mode mode) {
  return Conv2d(x, spectral_.Normalised(weight, mode), bias, options_);
}

Var ConvTranspose2dLayer::Forward(const Var& x, Mode mode) {
  return ConvTranspose2d(x, spectral_.Normalised(weight, mode), bias, options_);
}

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

GroupNormLayer::GroupNormLayer(Context& context, std::int64_t channels, std::int64_t groups,
                               const NormOptions& options)
    : weight(Parameter(context, context.Full({channels}, 1.0))),
      bias(Parameter(context, context.Zeros({channels}))),
      groups_(groups),
      options_(options) {}

Var GroupNormLayer::Forward(const Var& x, Mode) {
  return GroupNorm(x, static_cast<int>(groups_), weight, bias, options_);
}

void GroupNormLayer::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  visitor.Parameter(prefix + "weight", weight);
  visitor.Parameter(prefix + "bias", bias);
}

Var Upsample::Forward(const Var& x, Mode) {
  if (!x.valid() || x.shape().rank() != 4) return Resize(x, {0, 0}, mode_);  // reports the error
  return Resize(x, {2 * x.shape()[2], 2 * x.shape()[3]}, mode_);
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

Var Residual::Forward(const Var& x, Mode mode) {
  return Add(shortcut.Forward(x, mode), body.Forward(x, mode));
}

void Residual::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  body.Visit(prefix + "body.", visitor);
  shortcut.Visit(prefix + "shortcut.", visitor);
}

void Sequential::Visit(const std::string& prefix, ModuleVisitor& visitor) {
  for (const auto& [name, module] : children_) module->Visit(prefix + name + ".", visitor);
}

}  // namespace tilegrad::nn
