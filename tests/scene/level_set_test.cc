// SPDX-License-Identifier: Apache-2.0
#include "scene/level_set.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>

#include "base/rng.h"
#include "scene/edit_mesh.h"
#include "scene/topology.h"

namespace tilegrad::level_set_test {

ScalarGrid GridOf(int n, const std::function<float(glm::vec3)>& value) {
  ScalarGrid grid{{n, n, n}, glm::vec3(-1), 2.0f / static_cast<float>(n - 1), {}};
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        grid.values.push_back(value(grid.low + grid.cell * glm::vec3(i, j, k)));
  return grid;
}

long Euler(const Mesh& mesh) {
  const auto edges = BuildTopology(mesh.faces, mesh.positions.size()).edges.size();
  return static_cast<long>(mesh.positions.size()) - static_cast<long>(edges) +
         static_cast<long>(mesh.faces.size());
}

double Volume(const Mesh& mesh) {
  double sum = 0;
  for (const Face& f : mesh.faces) {
    const glm::dvec3 a(mesh.positions[static_cast<std::size_t>(f[0])]),
        b(mesh.positions[static_cast<std::size_t>(f[1])]),
        c(mesh.positions[static_cast<std::size_t>(f[2])]);
    sum += glm::dot(a, glm::cross(b, c)) / 6;
  }
  return sum;
}

// Checkerboards, lone points and diagonal neighbours: all that is ambiguous in cells.
TEST(LevelSet, OfRandomNumbersIsAClosedManifold) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const double share = 0.1 + 0.04 * static_cast<double>(seed);
    const Mesh mesh = LevelSet(GridOf(9, [&](glm::vec3) {
      return static_cast<float>(rng.Uniform() < share ? 1 : -rng.Uniform());
    }));
    ASSERT_GT(mesh.faces.size(), 100u);
    const auto edit = EditMesh::Make(mesh.positions, mesh.faces);
    EXPECT_TRUE(edit.ok()) << "seed " << seed << ": " << edit.status().message();
    EXPECT_GT(Volume(mesh), 0);
  }
}

TEST(LevelSet, ZeroIsOutsideAndBordersAreClosed) {
  EXPECT_TRUE(LevelSet(GridOf(5, [](glm::vec3) { return 0.0f; })).faces.empty());
  const Mesh box = LevelSet(GridOf(5, [](glm::vec3) { return 1.0f; }));
  EXPECT_EQ(Euler(box), 2);
  EXPECT_GT(Volume(box), 1);  // the middle 3 x 3 x 3 points; the cube has 8
}

TEST(LevelSet, HasTheTopologyAndTheVolumeOfATorus) {
  const Mesh torus = LevelSet(
      GridOf(41, [](glm::vec3 p) { return 0.25f - std::hypot(std::hypot(p.x, p.y) - 0.6f, p.z); }));
  EXPECT_EQ(Euler(torus), 0);
  const double truth = 2 * std::numbers::pi * std::numbers::pi * 0.6 * 0.25 * 0.25;
  EXPECT_NEAR(Volume(torus), truth, 0.02 * truth);
}

TEST(LevelSet, KeepsPartsApart) {
  const Mesh two = LevelSet(GridOf(31, [](glm::vec3 p) {
    return 0.4f -
           std::min(glm::length(p - glm::vec3(0.5f, 0, 0)), glm::length(p + glm::vec3(0.5f, 0, 0)));
  }));
  EXPECT_EQ(Euler(two), 4);
  EXPECT_TRUE(EditMesh::Make(two.positions, two.faces).ok());
}

}  // namespace tilegrad::level_set_test
