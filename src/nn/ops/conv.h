// SPDX-License-Identifier: Apache-2.0
// Cross-correlation of images (what the field calls convolution), and the two operations that are
// its derivatives. Each of the three is the derivative of the others, so together they are closed.
#pragma once

#include "nn/ops/axis_map.h"
#include "nn/ops/shape.h"
#include "nn/tape.h"

namespace tilegrad::nn {

struct ConvOptions {
  int stride = 1;                         // >= 1
  int padding = 0;                        // pixels added on every side, >= 0
  PadMode padding_mode = PadMode::kZero;  // the two gradients: zero only
};

// x [n, in, h, w], weight [out, in, kh, kw], bias [out] or an invalid Var for none ->
// [n, out, (h + 2 padding - kh) / stride + 1, ...], rounded down.
Var Conv2d(const Var& x, const Var& weight, const Var& bias, const ConvOptions& options);

// The adjoint of x: dy [n, out, oh, ow] -> [n, in, height, width].
Var Conv2dInputGrad(const Var& dy, const Var& weight, ImageSize size, const ConvOptions& options);

// The adjoint of the weight -> [out, in, kernel.height, kernel.width].
Var Conv2dWeightGrad(const Var& x, const Var& dy, ImageSize kernel, const ConvOptions& options);

}  // namespace tilegrad::nn
