// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/broadcast.h"

#include <algorithm>

namespace tilegrad::nn {
namespace {

// Extent of `axis` of a result of rank `rank`, with 1 for what is missing in front.
std::int64_t AlignedExtent(const Shape& shape, int axis, int rank) {
  const int own = axis - (rank - shape.rank());
  return own < 0 ? 1 : shape[own];
}

// Strides by which an operand is walked over the axes of the result.
Broadcast::Extents StridesFor(const Shape& operand, int rank) {
  Broadcast::Extents strides{};
  std::size_t stride = 1;
  for (int axis = rank - 1; axis >= 0; --axis) {
    const auto extent = static_cast<std::size_t>(AlignedExtent(operand, axis, rank));
    strides[static_cast<std::size_t>(axis)] = extent == 1 ? 0 : stride;
    stride *= extent;
  }
  return strides;
}

}  // namespace

bool BroadcastShape(const Shape& a, const Shape& b, Shape& result) {
  const int rank = std::max(a.rank(), b.rank());
  result = {};
  for (int axis = 0; axis < rank; ++axis) {
    const std::int64_t ea = AlignedExtent(a, axis, rank), eb = AlignedExtent(b, axis, rank);
    if (ea != eb && ea != 1 && eb != 1) return false;
    result.Append(ea == 1 ? eb : ea);
  }
  return true;
}

Broadcast PlanBroadcast(const Shape& result, const Shape& a, const Shape& b) {
  const int rank = result.rank();
  const std::array<Broadcast::Extents, 2> strides = {StridesFor(a, rank), StridesFor(b, rank)};
  Broadcast plan;
  auto out = static_cast<std::size_t>(Shape::kMaxRank);  // filled from the back
  for (int axis = rank - 1; axis >= 0; --axis) {
    const auto i = static_cast<std::size_t>(axis);
    const auto extent = static_cast<std::size_t>(result[axis]);
    if (extent == 1) continue;
    const bool merges = out < Shape::kMaxRank && [&] {
      for (std::size_t k = 0; k < 2; ++k) {
        const std::size_t inner = plan.strides[k][out];
        if (strides[k][i] != inner * plan.extents[out]) return false;
      }
      return true;
    }();
    if (!merges) {
      --out;
      for (std::size_t k = 0; k < 2; ++k) plan.strides[k][out] = strides[k][i];
      plan.extents[out] = 1;
    }
    plan.extents[out] *= extent;
  }
  return plan;
}

}  // namespace tilegrad::nn
