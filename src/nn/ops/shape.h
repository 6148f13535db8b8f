// SPDX-License-Identifier: Apache-2.0
// Operations that move elements and compute nothing: each is linear, and is the adjoint of another
// one.
#pragma once

#include <span>

#include "nn/tape.h"

namespace tilegrad::nn {

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

// y[.., i, ..] = x[.., indices[i], ..] along `axis`; indices: [n] of kI32 within the extent, else
// an error. Adjoint: ScatterAdd.
Var Gather(const Var& x, int axis, const Tensor& indices);
// y of extent `extent` along `axis`: y[.., indices[i], ..] += x[.., i, ..], in the order of i.
Var ScatterAdd(const Var& x, int axis, const Tensor& indices, std::int64_t extent);

}  // namespace tilegrad::nn
