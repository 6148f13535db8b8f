// SPDX-License-Identifier: Apache-2.0

#include "nn/kernels/gemm.h"
#include "nn/kernels/gemm_ref.h"
#include "nn/ops.h"

namespace tilegrad::nn {
namespace {

void Multiply(const GemmProblem<float>& problem, Context& context) {
  Gemm(problem, context.kernels());
}

void Multiply(const GemmProblem<double>& problem, Context&) { GemmRef(problem); }

// op(a) op(b) + bias; shapes were checked. `bias` may be invalid.
Tensor Product(const Var& a, const Var& b, const Var& bias, const MatmulOptions& options) {
  const auto extent = [](const Var& v, int axis) {
    return static_cast<std::size_t>(v.shape()[axis]);
  };
  const std::size_t m = extent(a, options.transpose_a ? 1 : 0);
  const std::size_t n = extent(b, options.transpose_b ? 0 : 1);
  const std::size_t k = extent(a, options.transpose_a ? 0 : 1);
  Context& context = a.context();
  Tensor c = context.Empty({static_cast<std::int64_t>(m), static_cast<std::int64_t>(n)}, a.dtype());
  WithFloatType(a.dtype(), [&]<class T>(T) {
    GemmProblem<T> problem;
    problem.m = m;
    problem.n = n;
    problem.k = k;
    problem.a = a.value().data<T>();
    problem.lda = extent(a, 1);
    problem.b = b.value().data<T>();
    problem.ldb = extent(b, 1);
    problem.transpose_a = options.transpose_a;
    problem.transpose_b = options.transpose_b;
    problem.c = c.data<T>();
    problem.ldc = n;
    problem.bias = bias.valid() ? bias.value().data<T>() : nullptr;
    Multiply(problem, context);
  });
  return c;
}

bool AreMatrices(const Var& a, const Var& b, const MatmulOptions& options) {
  return a.shape().rank() == 2 && b.shape().rank() == 2 &&
         a.shape()[options.transpose_a ? 0 : 1] == b.shape()[options.transpose_b ? 1 : 0];
}

}  // namespace

// c = op(a) op(b):  d_a = d_c op(b)^T,  d_b = op(a)^T d_c,  each transposed back where a or b was.
Var Matmul(const Var& a, const Var& b, const MatmulOptions& options) {
  if (!Usable("matmul", {&a, &b})) return Invalid({&a, &b});
  if (!AreMatrices(a, b, options))
    return Refuse(a, "matmul: {}{} by {}{}", a.shape(), options.transpose_a ? "^T" : "", b.shape(),
                  options.transpose_b ? "^T" : "");
  const bool ta = options.transpose_a, tb = options.transpose_b;
  if (!IsPossibleResult("matmul", a, {a.shape()[ta ? 1 : 0], b.shape()[tb ? 0 : 1]}))
    return Invalid({&a});
  return Record({"matmul"}, Product(a, b, Var(), options), {a, b},
                [a, b, ta, tb](const Adjoint& adj) {
                  const Var& dc = adj.dy();
                  Vars d(2);
                  if (adj.needs(0))
                    d[0] = ta ? Matmul(b, dc, {tb, true}) : Matmul(dc, b, {false, !tb});
                  if (adj.needs(1))
                    d[1] = tb ? Matmul(dc, a, {true, ta}) : Matmul(a, dc, {!ta, false});
                  return d;
                });
}

Var Linear(const Var& x, const Var& w, const Var& b) {
  const bool usable = b.has_context() ? Usable("linear", {&x, &w, &b}) : Usable("linear", {&x, &w});
  if (!usable) return Invalid({&x, &w, &b});
  const MatmulOptions options{false, true};
  if (!AreMatrices(x, w, options) || (b.valid() && !(b.shape() == Shape{w.shape()[0]})))
    return Refuse(x, "linear: input {}, weight {}, bias {}", x.shape(), w.shape(), b.shape());
  if (!IsPossibleResult("linear", x, {x.shape()[0], w.shape()[0]})) return Invalid({&x});
  const auto rule = [x, w](const Adjoint& adj) {
    const Var& dy = adj.dy();
    return Vars{adj.needs(0) ? Matmul(dy, w) : Var(), adj.needs(1) ? adj.Product(1, dy, x) : Var(),
                adj.needs(2) ? Sum(dy, {0}) : Var()};
  };
  return Record({"linear"}, Product(x, w, b, options), {x, w, b}, rule);
}

}  // namespace tilegrad::nn
