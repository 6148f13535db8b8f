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

}  // namespace tilegrad::nn
