// SPDX-License-Identifier: Apache-2.0
#include "scene/edit_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>

#include "base/rng.h"
#include "scene/level_set.h"
#include "scene/shapes.h"
#include "scene/simplify.h"
#include "scene/topology.h"
#include "support/expect.h"

namespace tilegrad::edit_mesh_test {

EditMesh Make(const Mesh& mesh) {
  auto made = EditMesh::Make(mesh.positions, mesh.faces);
  EXPECT_TRUE(made.ok()) << made.status().message();
  return std::move(*made);
}

bool IsManifold(const EditMesh& mesh) {
  const Mesh packed = mesh.Pack();
  return EditMesh::Make(packed.positions, packed.faces).ok();
}

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

Mesh Torus(int n) {
  return LevelSet(
      GridOf(n, [](glm::vec3 p) { return 0.25f - std::hypot(std::hypot(p.x, p.y) - 0.6f, p.z); }));
}

TEST(EditMesh, RefusesWhatIsNotAClosedManifold) {
  const Mesh sphere = Icosphere(1, 1);
  std::vector<Face> open = sphere.faces, turned = sphere.faces, twice = sphere.faces;
  open.pop_back();
  EXPECT_FALSE(EditMesh::Make(sphere.positions, open).ok());
  std::swap(turned[0][0], turned[0][1]);
  EXPECT_FALSE(EditMesh::Make(sphere.positions, turned).ok());
  twice.insert(twice.end(), sphere.faces.begin(), sphere.faces.end());
  EXPECT_FALSE(EditMesh::Make(sphere.positions, twice).ok());
  // Two spheres that share a vertex: each edge is fine, the vertex is not.
  Mesh touching = sphere;
  for (Face f : sphere.faces) {
    for (std::int32_t& v : f)
      if (v != 0) v += static_cast<std::int32_t>(sphere.positions.size()) - 1;
    touching.faces.push_back(f);
  }
  touching.positions.resize(2 * sphere.positions.size() - 1);
  EXPECT_FALSE(EditMesh::Make(touching.positions, touching.faces).ok());
}

// On a tetrahedron and on a ring of three vertices, collapses would leave no surface.
TEST(EditMesh, LinkConditionRefusesWhatWouldChangeTheTopology) {
  Mesh tetrahedron;
  tetrahedron.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  tetrahedron.faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const EditMesh small = Make(tetrahedron);
  for (const auto& [a, b] : small.Edges()) EXPECT_FALSE(small.CanCollapse(a, b));
  // A prism of two triangles with a point on each end: its rings of three cannot be drawn together.
  Mesh prism;
  prism.positions = {{1, 0, 0}, {0, 1, 0},   {-1, -1, 0}, {1, 0, 1},
                     {0, 1, 1}, {-1, -1, 1}, {0, 0, -1},  {0, 0, 2}};
  prism.faces = {{0, 1, 3}, {1, 4, 3}, {1, 2, 4}, {2, 5, 4}, {2, 0, 5}, {0, 3, 5},
                 {1, 0, 6}, {2, 1, 6}, {0, 2, 6}, {3, 4, 7}, {4, 5, 7}, {5, 3, 7}};
  const EditMesh tube = Make(prism);
  EXPECT_FALSE(tube.CanCollapse(0, 1));
  EXPECT_TRUE(tube.CanCollapse(0, 3));
}

// Any collapses that are allowed, in any order.
TEST(EditMesh, StaysAManifoldOfTheSameTopology) {
  EditMesh mesh = Make(Torus(13));
  ASSERT_EQ(Euler(mesh.Pack()), 0);
  Rng rng(3);
  int collapsed = 0;
  for (int round = 0; round < 3000; ++round) {
    const auto face = static_cast<std::int32_t>(rng.Below(mesh.faces().size()));
    if (!mesh.IsFaceAlive(face)) continue;
    const Face f = mesh.faces()[static_cast<std::size_t>(face)];
    if (!mesh.CanCollapse(f[0], f[1])) continue;
    mesh.Collapse(f[0], f[1], mesh.Position(f[0]));
    if (++collapsed % 20 == 0) {
      ASSERT_TRUE(IsManifold(mesh)) << "round " << round;
    }
  }
  EXPECT_GT(collapsed, 50);
  EXPECT_TRUE(IsManifold(mesh));
  EXPECT_EQ(Euler(mesh.Pack()), 0);
}

TEST(EditMesh, CollapsedEdgesStandWhereTheyAreTold) {
  EditMesh mesh = Make(Icosphere(1, 1));
  const Face f = mesh.faces()[0];
  ASSERT_TRUE(mesh.CanCollapse(f[0], f[1]));
  mesh.Collapse(f[0], f[1], glm::vec3(7, 8, 9));
  EXPECT_EQ(mesh.Position(f[0]), glm::vec3(7, 8, 9));
  EXPECT_TRUE(mesh.FacesAt(f[1]).empty());
  EXPECT_EQ(mesh.Pack().positions.size() + 1, mesh.vertices());
}

TEST(Simplified, KeepsShapeAndTopologyWithFewFaces) {
  const Mesh fine = Torus(41);
  const auto coarse = Ok(Simplified(fine, {.error = 0.01f, .patch = 0.005f}));
  EXPECT_LT(coarse->faces.size(), fine.faces.size() / 10);
  Make(*coarse);  // a closed manifold
  EXPECT_EQ(Euler(*coarse), 0);
  for (const glm::vec3& p : coarse->positions)
    EXPECT_NEAR(std::hypot(std::hypot(p.x, p.y) - 0.6f, p.z), 0.25f, 0.02f);
}

TEST(Simplified, EndsAtTheFacesAndTheLengthAskedFor) {
  const Mesh fine = Torus(41);
  const auto few = Ok(Simplified(fine, {.error = 0, .most_faces = 1000}));
  EXPECT_LE(few->faces.size(), 1000u);
  EXPECT_GE(few->faces.size(), 996u);
  const auto fine_enough = Ok(Simplified(fine, {.error = 1, .longest = 0.2f}));
  for (const Face& f : fine_enough->faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3 a = fine_enough->positions[static_cast<std::size_t>(f[k])],
                      b = fine_enough->positions[static_cast<std::size_t>(f[(k + 1) % 3])];
      EXPECT_LE(glm::length(a - b), 0.2001f);
    }
  }
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
  const Mesh torus = Torus(41);
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

}  // namespace tilegrad::edit_mesh_test
