// SPDX-License-Identifier: Apache-2.0
#include "nn/kernels/pointwise.h"

#include <utility>

#include "nn/ops.h"
#include "nn/ops/broadcast.h"

namespace tilegrad::nn {
namespace {

Tensor ComputeUnary(UnaryOp op, const Var& x, double p = 0) {
  Tensor y = x.context().Empty(x.shape(), x.dtype());
  WithFloatType(x.dtype(), [&]<class T>(T) {
    Unary(UnaryProblem<T>{op, x.value().data<T>(), y.data<T>(), y.elements(), p},
          x.context().workers());
  });
  return y;
}

// y = f(x), d_x = rule(adjoint): what every unary operation below is.
Var UnaryVar(const OpInfo& info, UnaryOp op, const Var& x, double p, Rule rule) {
  if (!Usable(info.name, {&x})) return Invalid({&x});
  return Record(info, ComputeUnary(op, x, p), {x}, std::move(rule));
}

Var Sign(const Var& x) {
  if (!Usable("sign", {&x})) return Invalid({&x});
  return Constant(x.context(), ComputeUnary(UnaryOp::kSign, x));
}

struct BinaryCall {
  BinaryOp op;
  double p = 0;
};

template <class T>
void FillProblem(const Broadcast& broadcast, BinaryProblem<T>& problem) {
  problem.extents = broadcast.extents;
  problem.strides_a = broadcast.strides[0];
  problem.strides_b = broadcast.strides[1];
}

// Writes to y, which may share memory with an operand of its shape.
Tensor ComputeBinary(const BinaryCall& call, const Var& a, const Var& b, Tensor y) {
  const Broadcast broadcast = PlanBroadcast(y.shape(), a.shape(), b.shape());
  WithFloatType(a.dtype(), [&]<class T>(T) {
    BinaryProblem<T> problem;
    problem.op = call.op;
    problem.p = call.p;
    FillProblem(broadcast, problem);
    problem.a = a.value().data<T>();
    problem.b = b.value().data<T>();
    problem.y = y.data<T>();
    Binary(problem, a.context().workers());
  });
  return y;
}

Var BinaryVar(const OpInfo& info, const BinaryCall& call, const Var& a, const Var& b, Rule rule) {
  if (!Usable(info.name, {&a, &b})) return Invalid({&a, &b});
  Shape shape;
  if (!BroadcastShape(a.shape(), b.shape(), shape))
    return Refuse(a, "{}: shapes {} and {} do not broadcast", info.name, a.shape(), b.shape());
  if (!IsPossibleResult(info.name, a, shape)) return Invalid({&a});
  Tensor y = a.context().Empty(shape, a.dtype());
  return Record(info, ComputeBinary(call, a, b, std::move(y)), {a, b}, std::move(rule));
}

// d_x of Relu and LeakyRelu from their output, whose sign is that of x. Piecewise linear: the
// second derivative with respect to y is zero, and with respect to d_y it is the same operation.
Var RectifierGrad(const BinaryCall& call, const Var& y, Var dy) {
  if (Usable("rectifier gradient", {&y, &dy}) && IsExpendable(dy) && y.shape() == dy.shape())
    return Constant(y.context(), ComputeBinary(call, y, dy, dy.value()));
  return BinaryVar({"rectifier gradient"}, call, Detach(y), dy, [call, y](const Adjoint& adj) {
    return Vars{Var(), RectifierGrad(call, y, adj.TakeDy())};
  });
}

}  // namespace

Var Add(const Var& a, const Var& b) {
  return BinaryVar({"add"}, {BinaryOp::kAdd}, a, b, [sa = a.shape(), sb = b.shape()](auto& adj) {
    return Vars{adj.needs(0) ? SumTo(adj.dy(), sa) : Var(),
                adj.needs(1) ? SumTo(adj.dy(), sb) : Var()};
  });
}

Var Sub(const Var& a, const Var& b) {
  return BinaryVar({"sub"}, {BinaryOp::kSub}, a, b, [sa = a.shape(), sb = b.shape()](auto& adj) {
    return Vars{adj.needs(0) ? SumTo(adj.dy(), sa) : Var(),
                adj.needs(1) ? Neg(SumTo(adj.dy(), sb)) : Var()};
  });
}

Var Mul(const Var& a, const Var& b) {
  return BinaryVar({"mul"}, {BinaryOp::kMul}, a, b, [a, b](const Adjoint& adj) {
    return Vars{adj.needs(0) ? SumTo(Mul(adj.dy(), b), a.shape()) : Var(),
                adj.needs(1) ? SumTo(Mul(adj.dy(), a), b.shape()) : Var()};
  });
}

// d(a / b) = d_a / b - (a / b) d_b / b
Var Div(const Var& a, const Var& b) {
  const OpInfo info{"div", /*save_output=*/true};
  return BinaryVar(info, {BinaryOp::kDiv}, a, b, [sa = a.shape(), b](const Adjoint& adj) {
    const Var scaled = Div(adj.dy(), b);
    return Vars{adj.needs(0) ? SumTo(scaled, sa) : Var(),
                adj.needs(1) ? Neg(SumTo(Mul(scaled, adj.y()), b.shape())) : Var()};
  });
}

Var Neg(const Var& x) {
  return UnaryVar({"neg"}, UnaryOp::kNeg, x, 0,
                  [](const Adjoint& adj) { return Vars{Neg(adj.dy())}; });
}

Var Scale(const Var& x, double factor) {
  return UnaryVar({"scale"}, UnaryOp::kScale, x, factor,
                  [factor](const Adjoint& adj) { return Vars{Scale(adj.dy(), factor)}; });
}

Var AddScalar(const Var& x, double term) {
  return UnaryVar({"add scalar"}, UnaryOp::kAddScalar, x, term,
                  [](const Adjoint& adj) { return Vars{adj.dy()}; });
}

Var Exp(const Var& x) {
  return UnaryVar({"exp", true}, UnaryOp::kExp, x, 0,
                  [](const Adjoint& adj) { return Vars{Mul(adj.dy(), adj.y())}; });
}

Var Log(const Var& x) {
  return UnaryVar({"log"}, UnaryOp::kLog, x, 0,
                  [x](const Adjoint& adj) { return Vars{Div(adj.dy(), x)}; });
}

Var Sqrt(const Var& x) {
  return UnaryVar({"sqrt", true}, UnaryOp::kSqrt, x, 0,
                  [](const Adjoint& adj) { return Vars{Scale(Div(adj.dy(), adj.y()), 0.5)}; });
}

Var Square(const Var& x) {
  return UnaryVar({"square"}, UnaryOp::kSquare, x, 0,
                  [x](const Adjoint& adj) { return Vars{Scale(Mul(adj.dy(), x), 2.0)}; });
}

Var Abs(const Var& x) {
  return UnaryVar({"abs"}, UnaryOp::kAbs, x, 0,
                  [x](const Adjoint& adj) { return Vars{Mul(adj.dy(), Sign(x))}; });
}

Var Relu(const Var& x) {
  return UnaryVar({"relu", true}, UnaryOp::kRelu, x, 0, [](const Adjoint& adj) {
    return Vars{RectifierGrad({BinaryOp::kReluGrad}, adj.y(), adj.TakeDy())};
  });
}

Var LeakyRelu(const Var& x, double slope) {
  if (!Usable("leaky relu", {&x})) return Invalid({&x});
  if (!(slope >= 0)) return Refuse(x, "leaky relu: slope {} is negative", slope);
  return UnaryVar({"leaky relu", true}, UnaryOp::kLeakyRelu, x, slope, [slope](const Adjoint& adj) {
    const BinaryCall call{BinaryOp::kLeakyReluGrad, slope};
    return Vars{RectifierGrad(call, adj.y(), adj.TakeDy())};
  });
}

Var ReluGrad(const Var& y, Var dy) {
  return RectifierGrad({BinaryOp::kReluGrad}, y, std::move(dy));
}

Var Accumulated(Var sum, const Var& term) {
  if (!Usable("accumulated", {&sum, &term}) || !IsExpendable(sum) ||
      !(sum.shape() == term.shape())) {
    return Add(sum, term);
  }
  return Constant(sum.context(), ComputeBinary({BinaryOp::kAdd}, sum, term, sum.value()));
}

Var Tanh(const Var& x) {  // 1 - y^2
  return UnaryVar({"tanh", true}, UnaryOp::kTanh, x, 0, [](const Adjoint& adj) {
    return Vars{Sub(adj.dy(), Mul(adj.dy(), Square(adj.y())))};
  });
}

Var Sigmoid(const Var& x) {  // y (1 - y)
  return UnaryVar({"sigmoid", true}, UnaryOp::kSigmoid, x, 0, [](const Adjoint& adj) {
    return Vars{Mul(adj.dy(), Sub(adj.y(), Square(adj.y())))};
  });
}

Var Softplus(const Var& x) {
  return UnaryVar({"softplus"}, UnaryOp::kSoftplus, x, 0,
                  [x](const Adjoint& adj) { return Vars{Mul(adj.dy(), Sigmoid(x))}; });
}

}  // namespace tilegrad::nn
