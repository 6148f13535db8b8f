// SPDX-License-Identifier: Apache-2.0
// Images of another size. Pixels are squares and both images fill the same square, as PyTorch has
// it with align_corners = False: output i is centred at (i + 1/2) in / out - 1/2 of the input.
#pragma once

#include "nn/ops/shape.h"
#include "nn/tape.h"

namespace tilegrad::nn {

enum class ResizeMode {
  kNearest,  // element floor(i in / out)
  kBilinear  // of the two neighbours; edges are repeated
};

// x [n, c, h, w] -> [n, c, size.height, size.width].
Var Resize(const Var& x, ImageSize size, ResizeMode mode);

}  // namespace tilegrad::nn
