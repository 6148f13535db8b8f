// SPDX-License-Identifier: Apache-2.0
#include "nn/optim.h"

#include <cmath>
#include <utility>

#include "base/error.h"
#include "nn/kernels/adam.h"

namespace tilegrad::nn {
namespace {

Tensor ZerosLike(Context& context, const Tensor& tensor) {
  Tensor zeros = context.Empty(tensor.shape(), tensor.dtype());
  std::fill_n(zeros.raw(), zeros.bytes(), std::byte{0});
  return zeros;
}

Status CheckGradient(const NamedVar& parameter, const Var& gradient) {
  const Tensor& p = parameter.value.value();
  if (gradient.valid() && gradient.shape() == p.shape() && gradient.dtype() == p.dtype()) return {};
  return InvalidArgument("Adam: parameter \"{}\" is {} of shape {}, its gradient {} of shape {}",
                         parameter.name, NameOf(p.dtype()), p.shape().ToString(),
                         gradient.valid() ? NameOf(gradient.dtype()) : "invalid",
                         gradient.shape().ToString());
}

}  // namespace

Adam::Adam(Context& context, std::vector<NamedVar> parameters, const AdamOptions& options)
    : context_(context), options_(options) {
  for (NamedVar& p : parameters) {
    const Tensor& value = p.value.value();
    slots_.push_back({p, ZerosLike(context, value), ZerosLike(context, value)});
  }
}

Status Adam::Step(std::span<const Var> gradients, double gradient_scale) {
  TILEGRAD_TRY(context_.status());
  if (gradients.size() != slots_.size()) {
    return InvalidArgument("Adam: {} gradients for {} parameters", gradients.size(), slots_.size());
  }
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    TILEGRAD_TRY(CheckGradient(slots_[i].parameter, gradients[i]));
  }
  ++steps_;
  const auto t = static_cast<double>(steps_);
  AdamCoefficients c{gradient_scale, options_.beta1, options_.beta2, options_.epsilon, 0, 0};
  c.step = options_.learning_rate / (1.0 - std::pow(options_.beta1, t));
  c.inverse_root = 1.0 / std::sqrt(1.0 - std::pow(options_.beta2, t));
  for (std::size_t i = 0; i < slots_.size(); ++i) Update(slots_[i], gradients[i].value(), c);
  return {};
}

void Adam::Update(Slot& slot, const Tensor& gradient, const AdamCoefficients& coefficients) {
  Tensor& parameter = slot.parameter.value.value();
  WithFloatType(parameter.dtype(), [&]<class T>(T) {
    AdamStep(AdamProblem<T>{parameter.elements(), parameter.data<T>(), gradient.data<T>(),
                            slot.m.data<T>(), slot.v.data<T>(), coefficients},
             context_.workers());
  });
}

std::vector<Var> Adam::parameters() const {
  std::vector<Var> result;
  for (const Slot& slot : slots_) result.push_back(slot.parameter.value);
  return result;
}

std::vector<NamedTensor> Adam::State() const {
  std::vector<NamedTensor> state;
  for (const Slot& slot : slots_) {
    state.push_back({"adam.m." + slot.parameter.name, slot.m});
    state.push_back({"adam.v." + slot.parameter.name, slot.v});
  }
  Tensor steps = context_.Empty({1}, DType::kI64);
  *steps.data<std::int64_t>() = steps_;
  state.push_back({"adam.steps", steps});
  return state;
}

Status Adam::LoadState(const std::vector<NamedTensor>& state) {
  std::vector<NamedTensor> own = State();
  TILEGRAD_TRY(CopyByName(state, own));
  steps_ = *own.back().value.data<std::int64_t>();
  return {};
}

double GlobalNorm(Context& context, std::span<const Var> gradients) {
  double sum = 0;
  for (const Var& g : gradients) {
    if (!g.valid()) continue;
    sum += WithFloatType(g.dtype(), [&]<class T>(T) {
      return SumOfSquares(g.value().data<T>(), g.value().elements(), context.workers());
    });
  }
  return std::sqrt(sum);
}

double ClipFactor(double norm, double max_norm) { return norm > max_norm ? max_norm / norm : 1.0; }

}  // namespace tilegrad::nn
