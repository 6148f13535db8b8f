// SPDX-License-Identifier: Apache-2.0
// Symmetric maps of a sphere.
#pragma once

#include "nn/nn.h"
#include "nn/ops/axis_map.h"

namespace tilegrad::train {

// Columns of a map of the sphere to the mean of themselves and their mirror image at x = 0, which
// is at 1/2 - u (scene/sphere_uv.h): column i has W/2 - 1 - i.
inline nn::AxisMap MirrorColumns(nn::Context& context, std::int64_t width) {
  return nn::MakeAxisMap(nn::Constant(context, 0.0), {width, width},
                         [&](std::int64_t i, nn::AxisTerms& terms) {
                           terms.push_back({i, 0.5});
                           terms.push_back({(width / 2 - 1 - i + width) % width, 0.5});
                         });
}

}  // namespace tilegrad::train
