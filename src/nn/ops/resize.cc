// SPDX-License-Identifier: Apache-2.0
#include "nn/ops/resize.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "nn/ops/axis_map.h"

namespace tilegrad::nn {
namespace {

void AppendBilinear(const AxisExtents& e, std::int64_t i, AxisTerms& terms) {
  const double scale = static_cast<double>(e.in) / static_cast<double>(e.out);
  const double at = std::max(0.0, (static_cast<double>(i) + 0.5) * scale - 0.5);
  const auto below = std::min(e.in - 1, static_cast<std::int64_t>(at));
  const double share = below == e.in - 1 ? 0.0 : at - static_cast<double>(below);
  terms.push_back({below, 1.0 - share});
  if (share > 0) terms.push_back({below + 1, share});
}

Var ResizeAxis(const Var& x, int axis, std::int64_t extent, ResizeMode mode) {
  const AxisExtents extents{x.shape()[axis], extent};
  if (extents.in == extent) return x;
  const auto row = [&](std::int64_t i, AxisTerms& terms) {
    if (mode == ResizeMode::kBilinear) return AppendBilinear(extents, i, terms);
    terms.push_back({i * extents.in / extents.out, 1.0});
  };
  return MapAxis(x, axis, MakeAxisMap(x, extents, row));
}

}  // namespace

Var Resize(const Var& x, ImageSize size, ResizeMode mode) {
  if (!Usable("resize", {&x})) return Invalid({&x});
  const bool image = x.shape().rank() == 4 && x.shape()[2] > 0 && x.shape()[3] > 0;
  const bool fits = size.height >= 1 && size.height <= AxisMap::kMostExtent && size.width >= 1 &&
                    size.width <= AxisMap::kMostExtent;
  if (!image || !fits) {
    return Fail(
        x, InvalidArgument("resize: {} to {} x {}", x.shape().ToString(), size.height, size.width));
  }
  if (!IsPossibleResult("resize", x, {x.shape()[0], x.shape()[1], size.height, size.width})) {
    return Invalid({&x});
  }
  return ResizeAxis(ResizeAxis(x, 2, size.height, mode), 3, size.width, mode);
}

}  // namespace tilegrad::nn
