// SPDX-License-Identifier: Apache-2.0
// Means and maxima over windows of images [n, c, h, w] -> [n, c, (h + 2 padding - kernel) / stride
// + 1, ...].
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

struct PoolOptions {
  int kernel = 2;   // side of the window
  int stride = 2;   // >= 1
  int padding = 0;  // on every side, at most kernel / 2
};

// Padded zeros count.
Var AvgPool2d(const Var& x, const PoolOptions& options);

// Padding never wins. The gradient goes to the first element of a window, in memory order, that
// attains its maximum; NaN wins.
Var MaxPool2d(const Var& x, const PoolOptions& options);

}  // namespace tilegrad::nn
