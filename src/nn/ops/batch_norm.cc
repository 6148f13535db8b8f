// SPDX-License-Identifier: Apache-2.0

#include "nn/kernels/batch_norm.h"

#include <utility>

#include "base/error.h"
#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

struct Operands {
  Var x, gamma, beta;
  BatchNormOptions options;
};

BatchNormShape ShapeOf(const Shape& x) {
  return {static_cast<std::size_t>(x[0]), static_cast<std::size_t>(x[1]),
          static_cast<std::size_t>(x.Product(2, x.rank()))};
}

// [c] as [1, c] or [1, c, 1, 1], to be broadcast over x.
Var AsChannels(const Var& v, const Shape& x) {
  return x.rank() == 2 ? Reshape(v, {1, x[1]}) : Reshape(v, {1, x[1], 1, 1});
}

Var SumChannels(const Var& v) {
  return v.shape().rank() == 2 ? Sum(v, {0}, Keep::kYes) : Sum(v, {0, 2, 3}, Keep::kYes);
}

Var MeanChannels(const Var& v) {
  return v.shape().rank() == 2 ? Mean(v, {0}, Keep::kYes) : Mean(v, {0, 2, 3}, Keep::kYes);
}

template <class T>
BatchNormParameters<T> ParametersOf(const Operands& o) {
  return {o.gamma.value().data<T>(), o.beta.value().data<T>(), o.options.epsilon, o.options.relu};
}

// The gradient in one fused pass, in dy's memory if unshared; it cannot be differentiated.
Vars FusedGrad(const Operands& o, const BatchStatistics& statistics, const Var& dy) {
  Context& context = o.x.context();
  Tensor dx = dy.value().unique() ? dy.value() : context.Empty(o.x.shape(), o.x.dtype());
  Tensor d_gamma = context.Empty(o.gamma.shape(), o.x.dtype());
  Tensor d_beta = context.Empty(o.gamma.shape(), o.x.dtype());
  WithFloatType(o.x.dtype(), [&]<class T>(T) {
    BatchNormBackwardProblem<T> problem{ShapeOf(o.x.shape()), ParametersOf<T>(o)};
    problem.x = o.x.value().data<T>();
    problem.mean = statistics.mean.data<T>();
    problem.variance = statistics.variance.data<T>();
    problem.d_y = dy.value().data<T>();
    problem.d_x = dx.data<T>();
    problem.d_gamma = d_gamma.data<T>();
    problem.d_beta = d_beta.data<T>();
    BatchNormBackward(problem, context.workers());
  });
  return {Constant(context, dx), Constant(context, d_gamma), Constant(context, d_beta)};
}

// The same formulas (kernels/batch_norm.h) in operations, for when they will be differentiated.
Vars ComposedGrad(const Operands& o, const Var& y, const Var& d) {
  const Shape& shape = o.x.shape();
  const Var dy = o.options.relu ? ReluGrad(y, d) : d;
  const Var centred = Sub(o.x, MeanChannels(o.x));
  const Var deviation = Sqrt(AddScalar(MeanChannels(Square(centred)), o.options.epsilon));
  const Var h = Div(centred, deviation);
  const Var d_gamma = SumChannels(Mul(dy, h));
  const Var d_beta = SumChannels(dy);
  const double share = static_cast<double>(shape[1]) / static_cast<double>(shape.elements());
  const Var spread = Sub(Sub(dy, Scale(d_beta, share)), Mul(h, Scale(d_gamma, share)));
  const Var dx = Mul(Div(AsChannels(o.gamma, shape), deviation), spread);
  return {dx, Reshape(d_gamma, o.gamma.shape()), Reshape(d_beta, o.gamma.shape())};
}

Status CheckOperands(const Var& x, const Var& gamma, const Var& beta) {
  const bool known = x.shape().rank() == 2 || x.shape().rank() == 4;
  if (known && gamma.shape() == Shape{x.shape()[1]} && beta.shape() == gamma.shape()) return {};
  return InvalidArgument("batch norm: input {}, gamma {}, beta {}", x.shape(), gamma.shape(),
                         beta.shape());
}

}  // namespace

BatchNormResult BatchNormTrain(const Var& x, const Var& gamma, const Var& beta,
                               const BatchNormOptions& options) {
  if (!Usable("batch norm", {&x, &gamma, &beta})) return {Invalid({&x, &gamma, &beta}), {}, {}};
  Status status = CheckOperands(x, gamma, beta);
  if (status.ok() && ShapeOf(x.shape()).count() < 2)
    status = InvalidArgument("batch norm: {} has no two elements to a channel", x.shape());
  if (!status.ok()) return {Fail(x, status), {}, {}};
  Context& context = x.context();
  const Operands operands{x, gamma, beta, options};
  Tensor y = context.Empty(x.shape(), x.dtype());
  BatchStatistics statistics{context.Empty(gamma.shape(), x.dtype()),
                             context.Empty(gamma.shape(), x.dtype())};
  WithFloatType(x.dtype(), [&]<class T>(T) {
    BatchNormForward(
        BatchNormForwardProblem<T>{ShapeOf(x.shape()), ParametersOf<T>(operands),
                                   x.value().data<T>(), y.data<T>(), statistics.mean.data<T>(),
                                   statistics.variance.data<T>()},
        context.workers());
  });
  // The output is saved only for the sign that relu's derivative needs in a graph of gradients.
  const auto rule = [operands, statistics](const Adjoint& adj) {
    return operands.x.context().recording() ? ComposedGrad(operands, adj.y(), adj.dy())
                                            : FusedGrad(operands, statistics, adj.TakeDy());
  };
  const OpInfo info{"batch norm", /*save_output=*/options.relu};
  return {Record(info, std::move(y), {x, gamma, beta}, rule), statistics.mean, statistics.variance};
}

Var BatchNormEval(const Var& x, const Var& gamma, const Var& beta,
                  const BatchStatistics& statistics, const BatchNormOptions& options) {
  if (!Usable("batch norm", {&x, &gamma, &beta})) return Invalid({&x, &gamma, &beta});
  if (const Status s = CheckOperands(x, gamma, beta); !s.ok()) return Fail(x, s);
  for (const Tensor* t : {&statistics.mean, &statistics.variance}) {
    if (!t->empty() && t->dtype() == x.dtype() && t->shape() == gamma.shape()) continue;
    return Refuse(x, "batch norm: input {}, running statistics of {} {}", x.shape(),
                  NameOf(t->dtype()), t->shape());
  }
  Context& context = x.context();
  const Var mean = Constant(context, statistics.mean);
  const Var variance = Constant(context, statistics.variance);
  const Var scale = Div(gamma, Sqrt(AddScalar(variance, options.epsilon)));
  const Var shift = Sub(beta, Mul(mean, scale));
  const Var y = Add(Mul(x, AsChannels(scale, x.shape())), AsChannels(shift, x.shape()));
  return options.relu ? Relu(y) : y;
}

}  // namespace tilegrad::nn
