// SPDX-License-Identifier: Apache-2.0
// How crisp a picture is.
#pragma once

#include <cstdint>
#include <span>

#include "tilegrad/status.h"

namespace tilegrad::train {

// Some planes of one picture: [channels][height][width], any range.
struct PlanarPicture {
  std::span<const float> values;
  int channels = 0, height = 0, width = 0;
};

// High-pass energy: the mean over channels and counted pixels of (I - B I)^2, where B is the
// binomial filter (1 2 1)^T (1 2 1) / 16. Counted is a pixel whose whole 3x3 window lies in the
// picture and, where `covered` [height][width] is given, at pixels that are not 0 there: the crisp
// outline of a blurred texture does not count. 0 of a constant picture and where no pixel counts;
// m^2 of a chequerboard of +m and -m. Compare it with the truth's on the truth's pixels: below it,
// a picture is blurred; above it, noisy. InvalidArgument: the sizes do not fit together, or a
// number is not finite.
Result<double> HighPassEnergy(const PlanarPicture& picture,
                              std::span<const std::uint8_t> covered = {});

}  // namespace tilegrad::train
