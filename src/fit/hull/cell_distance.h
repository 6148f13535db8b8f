// SPDX-License-Identifier: Apache-2.0
// How far each cell of a grid is from the nearest empty one.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"

namespace tilegrad::train {

// `full` [x][y][z]: not 0 where a cell is full; what lies beyond the grid is empty. Returns the
// distance between the centres of a cell and of the nearest empty one, in cells; 0 of empty ones.
// Exact (P. Felzenszwalb, D. Huttenlocher: Distance transforms of sampled functions, 2012).
std::vector<float> DistanceToEmpty(const std::vector<std::uint8_t>& full,
                                   const std::array<int, 3>& size, const Workers& workers);

}  // namespace tilegrad::train
