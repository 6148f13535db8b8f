// SPDX-License-Identifier: Apache-2.0
// The zero level set of a function on a grid.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <vector>

#include "scene/mesh.h"

namespace tilegrad {

// Values at the points low + cell * (i, j, k); positive is inside.
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

// Marching tetrahedra (Doi, Koide 1991) on Kuhn's six tetrahedra per cell, which match across
// cells. The function is linear in each and nonzero at every grid point (0 counts as outside), so
// its level set is a closed manifold, of any genus and any number of components. Points on the
// border count as outside. Vertices stay a twentieth of an edge away from its ends. Positions and
// faces only, in an order that depends on the values alone; empty if nothing is inside.
Mesh LevelSet(const ScalarGrid& grid);

}  // namespace tilegrad
