// SPDX-License-Identifier: Apache-2.0
// Pictures looked up at places that a network says: CMR's texture flow (Kanazawa et al., ECCV 2018,
// section 2.2).
#pragma once

#include "nn/tape.h"

namespace tilegrad::nn {

// pictures [B, C, H, W], which get no gradient; flow [B, 2, h, w]: x and y in [-1, 1] across the
// picture, x right, y down. Returns [B, C, h, w], bilinear between pixel centres; beyond the edges
// the edge goes on, without a gradient that leads back.
Var SamplePictures(const Tensor& pictures, const Var& flow);

// Colours that are read from the picture instead of being remembered: each vertex is told where to
// look, how widely, and how much brighter or darker it is than what it sees there. A soft form of
// the texture flow of Kanazawa et al. (ECCV 2018).

// images: [B, 4, size, size], RGB over black and alpha; size is a multiple of 16. They are averaged
// over 16 x 16 cells, and take no gradient.
// flow: [B, V, 4]: (x, y) in [-1, 1] across the picture, x to the right and y down; n: the variance
// of the bell around (x, y) is (1/8)^2 + e^-n, and without bound below n = -20; g: the colour is 1
// + g times the mean under the bell, of what the object covers. Any finite number is allowed.
// Returns [B, V, 3], linear as the picture, not clamped. Its gradient has no gradient.
Var SampleColors(const Tensor& images, const Var& flow);

}  // namespace tilegrad::nn
