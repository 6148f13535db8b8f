// SPDX-License-Identifier: Apache-2.0
// What a search for cameras knows of its pictures.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "fit/poses/crop.h"

namespace tilegrad::train {

struct PosePictures {
  TargetImages images;         // of few pixels
  std::vector<Camera> lenses;  // intrinsics of such a picture; their poses mean nothing
  std::vector<Crop> crops;     // of the pictures as they came
  std::array<float, 3> mean_color = {};
  double color_weight = 1;  // of the L1 difference of colours beside 1 - IoU
};

// Pictures of about `side` pixels along their longer side: a whole number of pixels becomes one,
// and what is left over at the right and below is cut off. `lenses`: intrinsics of each. An error
// names the first picture that shows no object.
Result<PosePictures> PreparePictures(const TargetImages& images, std::span<const Camera> lenses,
                                     int side);

// How unlike any two pictures are, [N,N], in units of the median.
std::vector<double> Unlikeness(const PosePictures& pictures);

}  // namespace tilegrad::train
