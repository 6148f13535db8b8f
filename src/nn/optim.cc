// SPDX-License-Identifier: Apache-2.0
#include "nn/optim.h"

#include <cmath>
#include <utility>

#include "base/error.h"
#include "nn/kernels/adam.h"
#include "nn/kernels/update.h"

namespace tilegrad::nn {
namespace {

Tensor ZerosLike(Context& context, const Tensor& tensor) {
  Tensor zeros = context.Empty(tensor.shape(), tensor.dtype());
  std::fill_n(zeros.raw(), zeros.bytes(), std::byte{0});
  return zeros;
}

Status CheckGradient(const std::string& optimizer, const NamedVar& parameter, const Var& gradient) {
  const Tensor& p = parameter.value.value();
  if (gradient.valid() && gradient.shape() == p.shape() && gradient.dtype() == p.dtype()) return {};
  return InvalidArgument("{}: parameter \"{}\" is {} of shape {}, its gradient {} of shape {}",
                         optimizer, parameter.name, NameOf(p.dtype()), p.shape().ToString(),
                         gradient.valid() ? NameOf(gradient.dtype()) : "invalid",
                         gradient.shape().ToString());
}

}  // namespace

Optimizer::Optimizer(Context& context, std::string name, std::vector<std::string> moments,
                     std::vector<NamedVar> parameters)
    : context_(context), name_(std::move(name)), moments_(std::move(moments)) {
  for (NamedVar& p : parameters) {
    Slot slot{p, {}};
    for (std::size_t i = 0; i < moments_.size(); ++i) {
      slot.moments.push_back(ZerosLike(context, p.value.value()));
    }
    slots_.push_back(std::move(slot));
    parameters_.push_back(p.value);
  }
}

Status Optimizer::Step(std::span<const Var> gradients, double gradient_scale) {
  TILEGRAD_TRY(context_.status());
  if (gradients.size() != slots_.size()) {
    return InvalidArgument("{}: {} gradients for {} parameters", name_, gradients.size(),
                           slots_.size());
  }
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    TILEGRAD_TRY(CheckGradient(name_, slots_[i].parameter, gradients[i]));
  }
  ++steps_;
  BeginStep(gradient_scale);
  for (std::size_t i = 0; i < slots_.size(); ++i) Update(slots_[i], gradients[i].value());
  return {};
}

std::vector<NamedTensor> Optimizer::State() const {
  std::vector<NamedTensor> state;
  for (const Slot& slot : slots_) {
    for (std::size_t i = 0; i < moments_.size(); ++i) {
      state.push_back({name_ + "." + moments_[i] + "." + slot.parameter.name, slot.moments[i]});
    }
  }
  Tensor steps = context_.Empty({1}, DType::kI64);
  *steps.data<std::int64_t>() = steps_;
  state.push_back({name_ + ".steps", steps});
  return state;
}

Status Optimizer::LoadState(const std::vector<NamedTensor>& state) {
  std::vector<NamedTensor> own = State();
  TILEGRAD_TRY(CopyByName(state, own));
  steps_ = *own.back().value.data<std::int64_t>();
  return {};
}

namespace {

double DecayOf(const Tensor& parameter, double weight_decay) {
  return parameter.shape().rank() > 1 ? weight_decay : 0.0;
}

}  // namespace

void Adam::BeginStep(double gradient_scale) {
  const auto t = static_cast<double>(steps());
  coefficients_ = {gradient_scale, options_.beta1, options_.beta2, options_.epsilon};
  coefficients_.step = options_.learning_rate / (1.0 - std::pow(options_.beta1, t));
  coefficients_.inverse_root = 1.0 / std::sqrt(1.0 - std::pow(options_.beta2, t));
}

void Adam::Update(Slot& slot, const Tensor& gradient) {
  Tensor& p = slot.parameter.value.value();
  coefficients_.keep = 1.0 - options_.learning_rate * DecayOf(p, options_.weight_decay);
  WithFloatType(p.dtype(), [&]<class T>(T) {
    AdamStep(AdamProblem<T>{p.elements(), p.data<T>(), gradient.data<T>(),
                            slot.moments[0].data<T>(), slot.moments[1].data<T>(), coefficients_},
             workers());
  });
}

void Sgd::Update(Slot& slot, const Tensor& gradient) {
  Tensor& p = slot.parameter.value.value();
  const SgdCoefficients c{options_.learning_rate, options_.momentum, gradient_scale_,
                          DecayOf(p, options_.weight_decay), options_.nesterov};
  WithFloatType(p.dtype(), [&]<class T>(T) {
    SgdStep(
        SgdProblem<T>{p.elements(), p.data<T>(), gradient.data<T>(), slot.moments[0].data<T>(), c},
        workers());
  });
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
