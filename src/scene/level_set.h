// SPDX-License-Identifier: Apache-2.0
// The surface where a function on a grid is 0.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad {

// Numbers at the points low + cell * (i, j, k); greater than 0 is inside.
struct ScalarGrid {
  std::array<int, 3> size = {0, 0, 0};  // points along x, y, z; 2 or more
  glm::vec3 low = {0, 0, 0};
  float cell = 1;             // > 0
  std::vector<float> values;  // [x][y][z], finite

  std::size_t At(int i, int j, int k) const {
    return (static_cast<std::size_t>(i) * static_cast<std::size_t>(size[1]) +
            static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(size[2]) +
           static_cast<std::size_t>(k);
  }
};

// Marching tetrahedra (Doi, Koide 1991) on Kuhn's six tetrahedra of each cell, which fit together
// from cell to cell. The function is linear in each and 0 at no point of the grid (0 counts as
// outside), so its level set is a closed manifold, of any genus and any number of parts. Points on
// the border count as outside. Vertices keep a twentieth of an edge away from its ends. Positions
// and faces only, in an order that depends on the values alone; empty if nothing is inside.
Mesh LevelSet(const ScalarGrid& grid);

}  // namespace tilegrad
