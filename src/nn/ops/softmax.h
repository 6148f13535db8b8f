// SPDX-License-Identifier: Apache-2.0
// Softmax over one axis and the losses of classification. The largest element is subtracted before
// exponentiation, so that no finite input overflows.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

// Of -infinity alone, or with infinity in it, the first two are NaN: there is no such distribution.
Var Softmax(const Var& x, int axis);
Var LogSoftmax(const Var& x, int axis);
// The axis is dropped. -infinity of -infinity alone, with gradient 0.
Var LogSumExp(const Var& x, int axis);

// logits [n, classes] -> mean over n of -log softmax[i, labels[i]]; labels: [n] of kI32.
Var CrossEntropy(const Var& logits, const Tensor& labels);
// The same for probabilities [n, classes]: mean over n of -sum target log softmax.
Var CrossEntropy(const Var& logits, const Var& target);

}  // namespace tilegrad::nn
