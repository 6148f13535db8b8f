// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/pad.h"

#include <algorithm>

#include "base/error.h"
#include "nn/ops/axis_map.h"
#include "nn/ops/shape.h"

namespace tilegrad::nn {
namespace {

// The element of [0, extent) that stands at position i, which may lie outside.
std::int64_t SourceOf(std::int64_t i, std::int64_t extent, PadMode mode) {
  if (mode == PadMode::kCircular) return ((i % extent) + extent) % extent;
  return std::clamp<std::int64_t>(i, 0, extent - 1);
}

}  // namespace

Var Pad(const Var& x, int axis, std::int64_t before, std::int64_t after, PadMode mode) {
  if (!Usable("pad", {&x})) return Invalid({&x});
  if (mode == PadMode::kZero) return Pad(x, axis, before, after);
  const std::int64_t extent = axis >= 0 && axis < x.shape().rank() ? x.shape()[axis] : 0;
  const std::int64_t most = std::max(before, after);
  if (extent <= 0 || before < 0 || after < 0 || most > AxisMap::kMostExtent ||
      before + extent + after > AxisMap::kMostExtent) {
    return Fail(x, InvalidArgument("pad: {} and {} along axis {} of {} in this mode", before, after,
                                   axis, x.shape().ToString()));
  }
  if (most == 0) return x;
  Shape padded = x.shape();
  padded[axis] += before + after;
  if (!IsPossibleResult("pad", x, padded)) return Invalid({&x});
  const AxisMap map = MakeAxisMap(x, {extent, padded[axis]}, [&](std::int64_t i, AxisTerms& terms) {
    terms.push_back({SourceOf(i - before, extent, mode), 1.0});
  });
  return MapAxis(x, axis, map);
}

Var PadImage(const Var& x, const Padding& padding, PadMode mode) {
  if (!Usable("pad image", {&x})) return Invalid({&x});
  if (x.shape().rank() != 4) {
    return Fail(x, InvalidArgument("pad image: {} is not [n, c, h, w]", x.shape().ToString()));
  }
  return Pad(Pad(x, 2, padding.top, padding.bottom, mode), 3, padding.left, padding.right, mode);
}

}  // namespace tilegrad::nn
