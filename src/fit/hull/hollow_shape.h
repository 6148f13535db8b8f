// SPDX-License-Identifier: Apache-2.0
// What a hull could be hollow by: its inside, less walls and a floor, open at the top.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "scene/level_set.h"

namespace tilegrad::train {

// Lengths are in cells of the hull's grid.
struct HollowShape {
  float wall = 2;   // thickness of the walls at the rim, and of the floor at the least
  float floor = 0;  // where the floor is, as a share of the height from the bottom to the rim
  float taper = 0;  // what the walls gain in thickness by each cell of depth
  float reach = 4;  // how far above the rim the lid bulges that is part of the hollow

  bool operator==(const HollowShape&) const = default;
};

// Whether a hollow may lie in a column of cells, [x][z]: 0 or 1.
using Footprint = std::vector<std::uint8_t>;
Footprint AllColumns(const ScalarGrid& hull);

// Layers of cells, along y, about which much of the hull ends upwards: where a lid may be; those
// with the largest lids first, three at most.
std::vector<int> RimsOf(const ScalarGrid& hull);

// One rim of a hull, whose section a little below is taken to go on above it, so that the lid does
// not count as a wall.
class HollowRim {
 public:
  // Walls stand also where the footprint ends. `hull` must outlive this.
  HollowRim(const ScalarGrid& hull, int layer, const Footprint& footprint, const Workers& workers);

  // How far inside of the hollow the hull's points are, world units.
  ScalarGrid Hollow(const HollowShape& shape) const;

 private:
  const ScalarGrid* hull_;
  int layer_, bottom_;
  std::vector<float> distance_;  // to what is not wall, cells
};

// `full` [x][y][z]: not 0 where a cell is full; what lies beyond the grid is empty. Returns the
// distance between the centres of a cell and of the nearest empty one, in cells; 0 of empty ones.
// Exact (P. Felzenszwalb, D. Huttenlocher: Distance transforms of sampled functions, 2012).
std::vector<float> DistanceToEmpty(const std::vector<std::uint8_t>& full,
                                   const std::array<int, 3>& size, const Workers& workers);

}  // namespace tilegrad::train
