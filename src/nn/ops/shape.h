// SPDX-License-Identifier: Apache-2.0
// Operations that move elements and compute nothing: each is linear, and is the adjoint of another
// one.
#pragma once

#include <span>

#include "nn/tape.h"

namespace tilegrad::nn {

struct ImageSize {
  std::int64_t height, width;
};

// Same elements, same order. One extent may be -1: it follows from the others.
Var Reshape(const Var& x, Shape shape);
// Repeats axes of extent 1 (and missing leading ones); adjoint: SumTo of ops/reduce.h.
Var BroadcastTo(const Var& x, const Shape& shape);
// y's axis i is x's axis axes[i].
Var Permute(const Var& x, std::span<const int> axes);
Var Permute(const Var& x, std::initializer_list<int> axes);
Var Transpose(const Var& x);  // of rank 2

// Elements [begin, end) of one axis. Adjoint: Pad.
Var Slice(const Var& x, int axis, std::int64_t begin, std::int64_t end);
// Zeros before and after along one axis. Adjoint: Slice.
Var Pad(const Var& x, int axis, std::int64_t before, std::int64_t after);
// One after the other along `axis`; all other extents are equal.
Var Concat(std::span<const Var> parts, int axis);
Var Concat(std::initializer_list<Var> parts, int axis);

}  // namespace tilegrad::nn
