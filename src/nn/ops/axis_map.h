// SPDX-License-Identifier: Apache-2.0
// A sparse linear map along one axis, the basis of padding, resizing and average pooling. Its
// adjoint is the map of the transposed matrix, so the operation is closed under differentiation.
#pragma once

#include <limits>

#include "base/function_ref.h"
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

}  // namespace tilegrad::nn
