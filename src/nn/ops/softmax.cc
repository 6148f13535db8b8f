// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/softmax.h"

#include <limits>

#include "base/error.h"
#include "nn/ops/index.h"
#include "nn/ops/pointwise.h"
#include "nn/ops/reduce.h"

namespace tilegrad::nn {
namespace {

// x minus its largest element along the axis, which is a constant: every function below is the same
// for any constant.
Var Lowered(const Var& x, int axis) { return Sub(x, Detach(ReduceMax(x, {axis}, Keep::kYes))); }

bool AreLogits(const Var& logits, std::int64_t rows) {
  return logits.shape().rank() == 2 && logits.shape()[0] == rows && rows > 0;
}

}  // namespace

Var LogSoftmax(const Var& x, int axis) {
  const Var z = Lowered(x, axis);
  return Sub(z, Log(Sum(Exp(z), {axis}, Keep::kYes)));
}

Var Softmax(const Var& x, int axis) {
  const Var e = Exp(Lowered(x, axis));
  return Div(e, Sum(e, {axis}, Keep::kYes));
}

Var LogSumExp(const Var& x, int axis) {
  if (!Usable("log sum exp", {&x})) return Invalid({&x});
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double most = x.dtype() == DType::kF64 ? std::numeric_limits<double>::max()
                                               : std::numeric_limits<float>::max();
  const Var largest = Detach(ReduceMax(x, {axis}, Keep::kYes));
  // Infinity minus infinity is NaN, so a finite number is subtracted. The sum has a term of 1 or
  // none at all, where the gradient of log 0 would be NaN.
  const Var lowered = Sub(x, Clamp(largest, -most, most));
  const Var sum = Clamp(Sum(Exp(lowered), {axis}, Keep::kYes), 0.5, kInfinity);
  return Sum(Add(Log(sum), largest), {axis});
}

Var CrossEntropy(const Var& logits, const Tensor& labels) {
  if (!Usable("cross-entropy", {&logits})) return Invalid({&logits});
  const std::int64_t rows = labels.empty() ? 0 : labels.shape().elements();
  if (!AreLogits(logits, rows)) {
    return Fail(logits, InvalidArgument("cross-entropy: logits {} with {} labels",
                                        logits.shape().ToString(), rows));
  }
  return Neg(Mean(TakeAlong(LogSoftmax(logits, 1), labels.Reshaped({rows, 1}))));
}

Var CrossEntropy(const Var& logits, const Var& target) {
  if (!Usable("cross-entropy", {&logits, &target})) return Invalid({&logits, &target});
  if (!(target.shape() == logits.shape()) || !AreLogits(logits, target.shape()[0])) {
    return Fail(logits, InvalidArgument("cross-entropy: logits {} with target {}",
                                        logits.shape().ToString(), target.shape().ToString()));
  }
  return Neg(Mean(Sum(Mul(target, LogSoftmax(logits, 1)), {1})));
}

}  // namespace tilegrad::nn
