// SPDX-License-Identifier: Apache-2.0
// Padding modes and operations.
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

// Of a b c with two elements on each side:
enum class PadMode {
  kZero,      // 0 0 a b c 0 0
  kCircular,  // b c a b c a b: textures that wrap around
  kReplicate  // a a a b c c c
};

Var Pad(const Var& x, int axis, std::int64_t before, std::int64_t after, PadMode mode);

struct Padding {
  std::int64_t top = 0, bottom = 0, left = 0, right = 0;
  static Padding All(std::int64_t n) { return {n, n, n, n}; }
};
// Of the last two axes of [n, c, h, w].
Var PadImage(const Var& x, const Padding& padding, PadMode mode);

}  // namespace tilegrad::nn
