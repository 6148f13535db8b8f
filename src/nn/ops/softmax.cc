// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/softmax.h"

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

Var CrossEntropy(const Var& logits, const Tensor& labels) {
  if (!Usable("cross-entropy", {&logits})) return Invalid({&logits});
  const std::int64_t rows = labels.empty() ? 0 : labels.shape().elements();
  if (!AreLogits(logits, rows)) {
    return Fail(logits, InvalidArgument("cross-entropy: logits {} with {} labels",
                                        logits.shape().ToString(), rows));
  }
  return Neg(Mean(TakeAlong(LogSoftmax(logits, 1), labels.Reshaped({rows, 1}))));
}

}  // namespace tilegrad::nn
