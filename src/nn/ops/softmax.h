// SPDX-License-Identifier: Apache-2.0
// Softmax over one axis and the losses of classification. The largest element is subtracted before
// exponentiation, so that no finite input overflows.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

// Of -infinity alone, or with infinity in it, both are NaN: there is no such distribution.
Var Softmax(const Var& x, int axis);
Var LogSoftmax(const Var& x, int axis);

// logits [n, classes] -> mean over n of -log softmax[i, labels[i]]; labels: [n] of kI32.
Var CrossEntropy(const Var& logits, const Tensor& labels);

}  // namespace tilegrad::nn
