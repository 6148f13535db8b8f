// SPDX-License-Identifier: Apache-2.0
// What operations share: the layout of NumPy-style broadcasting for a kernel, and when a result may
// overwrite an operand.
#pragma once

#include <array>
#include <cstddef>

#include "nn/tape.h"

namespace tilegrad::nn {

// The shape to which a and b are broadcast; false if they do not match.
bool BroadcastShape(const Shape& a, const Shape& b, Shape& result);

// Merges axes where both operands allow it, so that loops are few and long. Unused leading axes
// have extent 1; an axis along which an operand is repeated has stride 0.
struct Broadcast {
  using Extents = std::array<std::size_t, Shape::kMaxRank>;
  Extents extents = {1, 1, 1, 1, 1};
  std::array<Extents, 2> strides{};
};
Broadcast PlanBroadcast(const Shape& result, const Shape& a, const Shape& b);

// Whether an operation that owns `v` may write its result there.
inline bool IsExpendable(const Var& v) { return v.value().unique() && !v.context().recording(); }

}  // namespace tilegrad::nn
