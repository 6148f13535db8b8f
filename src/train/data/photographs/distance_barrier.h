// SPDX-License-Identifier: Apache-2.0
// Distances of pixels from a mask, which keep CMR's texture flow on the object (compute_dt_barrier
// of its code).
#pragma once

#include <span>
#include <vector>

namespace tilegrad::train {

// For each pixel of mask [size][size] (inside where >= 1/2) the squared Euclidean distance to the
// nearest pixel that is `inside`, in pixels; very large where there is none. P. Felzenszwalb, D.
// Huttenlocher, "Distance transforms of sampled functions", 2012.
std::vector<double> SquaredDistances(std::span<const float> mask, int size, bool inside);

// 1 / (1 + exp(-50 d)), d: the distance to the object minus the distance to the background,
// relative to the side. About 0 inside, 1/2 at the edge and 1 outside. Into out [size][size].
void DistanceBarrier(std::span<const float> mask, int size, std::span<float> out);

}  // namespace tilegrad::train
