// SPDX-License-Identifier: Apache-2.0
// Reductions over axes. The reduced axes are dropped, or kept with extent 1 for broadcasting.
#pragma once

#include <initializer_list>

#include "nn/tape.h"

namespace tilegrad::nn {

enum class Keep { kNo, kYes };

Var Sum(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);
Var Sum(const Var& x);  // over everything: a scalar
Var Mean(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);
Var Mean(const Var& x);

// Largest and smallest element over axes of extent > 0. The gradient goes to the first (in memory
// order) that attains it. NaN wins.
Var ReduceMax(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);
Var ReduceMin(const Var& x, std::initializer_list<int> axes, Keep keep = Keep::kNo);

// Sums what broadcasting to x's shape had repeated. Adjoint of BroadcastTo.
Var SumTo(const Var& x, const Shape& shape);

// Softmax over one axis and the losses of classification. The largest element is subtracted before
// exponentiation, so that no finite input overflows.

// Of -infinity alone, or with infinity in it, both are NaN: there is no such distribution.
Var Softmax(const Var& x, int axis);
Var LogSoftmax(const Var& x, int axis);

// logits [n, classes] -> mean over n of -log softmax[i, labels[i]]; labels: [n] of kI32.
Var CrossEntropy(const Var& logits, const Tensor& labels);

}  // namespace tilegrad::nn
