// SPDX-License-Identifier: Apache-2.0
// A sparse linear map along one axis, and padding and resizing, which are such maps. Its
// adjoint is the map of the transposed matrix, so the operation is closed under differentiation.
#pragma once

#include <limits>

#include "base/function_ref.h"
#include "nn/ops/shape.h"
#include "nn/tape.h"

namespace tilegrad::nn {

// A matrix [out, in] in compressed rows.
struct AxisMap {
  // Of `in` and `out`; MakeAxisMap requires it.
  static constexpr std::int64_t kMostExtent = std::numeric_limits<std::int32_t>::max();

  std::int64_t in = 0, out = 0;
  Tensor begin;   // [out + 1] of kI32: row i has the terms begin[i] .. begin[i + 1]
  Tensor index;   // [terms] of kI32, below `in`
  Tensor weight;  // [terms]
};

struct AxisTerm {
  std::int64_t index;
  double weight;
};
using AxisTerms = StepVector<AxisTerm>;

// `row(i, terms)` appends the terms of row i.
struct AxisExtents {
  std::int64_t in, out;
};
AxisMap MakeAxisMap(const Var& like, const AxisExtents& extents,
                    FunctionRef<void(std::int64_t i, AxisTerms& terms)> row);

// y[.., i, ..] = sum_t weight[t] x[.., index[t], ..] over the terms t of row i.
Var MapAxis(const Var& x, int axis, const AxisMap& map);

// Padding modes and operations.

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

// Images of another size. Pixels are squares and both images fill the same square, as PyTorch has
// it with align_corners = False: output i is centred at (i + 1/2) in / out - 1/2 of the input.

enum class ResizeMode {
  kNearest,  // element floor(i in / out)
  kBilinear  // of the two neighbours; edges are repeated
};

// x [n, c, h, w] -> [n, c, size.height, size.width].
Var Resize(const Var& x, ImageSize size, ResizeMode mode);

}  // namespace tilegrad::nn
