// SPDX-License-Identifier: Apache-2.0
// Vertices as N3MR's training code parameterises them (and SoftRas's after it): each coordinate
// keeps its sign and moves between 0 and the side of a cube, then a centroid moves within it.
#pragma once

#include "nn/tape.h"

namespace tilegrad::train {

// With s = `sphere` [V,3], of unit radius, bias [B,V,3] and centroid [B,1,3]:
//
//   u = sign(s) sigmoid(logit(|s| / 2) + bias),   c = tanh(0.1 centroid),
//   v = max(u, 0) (1 - c) - max(-u, 0) (1 + c) + c
//
// Returns v / 2 [B,V,3], within (-1/2, 1/2); s / 4 where bias and centroid are 0. As published, a
// coordinate where s is 0 has u = 0 whatever its bias, without a gradient.
nn::Var SphereVertices(const nn::Var& bias, const nn::Var& centroid, const nn::Tensor& sphere);

}  // namespace tilegrad::train
