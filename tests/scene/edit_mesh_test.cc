// SPDX-License-Identifier: Apache-2.0
#include "scene/edit_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "base/rng.h"
#include "scene/level_set.h"
#include "scene/shapes.h"
#include "scene/simplify.h"
#include "scene/topology.h"

namespace tilegrad::edit_mesh_test {

VertexRows RowsOf(const Mesh& mesh) {
  VertexRows rows;
  for (const glm::vec3& p : mesh.positions) rows.values.insert(rows.values.end(), {p.x, p.y, p.z});
  return rows;
}

EditMesh Make(const Mesh& mesh) {
  auto made = EditMesh::Make(RowsOf(mesh), mesh.faces);
  EXPECT_TRUE(made.ok()) << made.status().message();
  return std::move(*made);
}

bool IsManifold(const EditMesh& mesh) {
  const EditMesh::Packed packed = mesh.Pack();
  return EditMesh::Make(packed.vertices, packed.faces).ok();
}

long Euler(const EditMesh& mesh) {
  const EditMesh::Packed packed = mesh.Pack();
  const Topology t = BuildTopology(packed.faces, packed.vertices.count());
  return static_cast<long>(packed.vertices.count()) - static_cast<long>(t.edges.size()) +
         static_cast<long>(packed.faces.size());
}

Mesh Torus(int n) {
  ScalarGrid grid{{n, n, n}, glm::vec3(-1), 2.0f / static_cast<float>(n - 1), {}};
  for (int i = 0; i < n * n * n; ++i) {
    const glm::vec3 p = grid.low + grid.cell * glm::vec3(i / n / n, i / n % n, i % n);
    grid.values.push_back(0.25f - std::hypot(std::hypot(p.x, p.y) - 0.6f, p.z));
  }
  return LevelSet(grid);
}

TEST(EditMesh, RefusesWhatIsNotAClosedManifold) {
  const Mesh sphere = Icosphere(1, 1);
  std::vector<Face> open = sphere.faces, turned = sphere.faces, twice = sphere.faces;
  open.pop_back();
  EXPECT_FALSE(EditMesh::Make(RowsOf(sphere), open).ok());
  std::swap(turned[0][0], turned[0][1]);
  EXPECT_FALSE(EditMesh::Make(RowsOf(sphere), turned).ok());
  twice.insert(twice.end(), sphere.faces.begin(), sphere.faces.end());
  EXPECT_FALSE(EditMesh::Make(RowsOf(sphere), twice).ok());
  // Two spheres that share a vertex: each edge is fine, the vertex is not.
  Mesh touching = sphere;
  for (Face f : sphere.faces) {
    for (std::int32_t& v : f)
      if (v != 0) v += static_cast<std::int32_t>(sphere.positions.size()) - 1;
    touching.faces.push_back(f);
  }
  touching.positions.resize(2 * sphere.positions.size() - 1);
  EXPECT_FALSE(EditMesh::Make(RowsOf(touching), touching.faces).ok());
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

// Any operations that are allowed, in any order.
TEST(EditMesh, StaysAManifoldOfTheSameTopology) {
  EditMesh mesh = Make(Torus(13));
  ASSERT_EQ(Euler(mesh), 0);
  Rng rng(3);
  int collapsed = 0, flipped = 0, split = 0;
  for (int round = 0; round < 3000; ++round) {
    const auto face = static_cast<std::int32_t>(rng.Below(mesh.faces().size()));
    if (!mesh.IsFaceAlive(face)) continue;
    const Face f = mesh.faces()[static_cast<std::size_t>(face)];
    const double what = rng.Uniform();
    if (what < 0.5 && mesh.CanCollapse(f[0], f[1])) {
      mesh.Collapse(f[0], f[1], mesh.vertices().Position(f[0])), ++collapsed;
    } else if (what < 0.8 && mesh.CanFlip(f[0], f[1])) {
      mesh.Flip(f[0], f[1]), ++flipped;
    } else if (what > 0.9) {
      mesh.Split(f[0], f[1]), ++split;
    }
    if (round % 100 == 0) {
      ASSERT_TRUE(IsManifold(mesh)) << "round " << round;
    }
  }
  EXPECT_GT(std::min({collapsed, flipped, split}), 50);
  EXPECT_TRUE(IsManifold(mesh));
  EXPECT_EQ(Euler(mesh), 0);
}

TEST(EditMesh, CarriesNumbersOfVerticesAlong) {
  VertexRows rows{4, {}};
  const Mesh sphere = Icosphere(1, 1);
  for (const glm::vec3& p : sphere.positions)
    rows.values.insert(rows.values.end(), {p.x, p.y, p.z, 10 * p.x});
  EditMesh mesh = EditMesh::Make(rows, sphere.faces).value();
  const Face f = mesh.faces()[0];
  const std::int32_t middle = mesh.Split(f[0], f[1]);
  const auto at = [&](std::int32_t v, std::size_t k) {
    return mesh.vertices().values[4 * static_cast<std::size_t>(v) + k];
  };
  EXPECT_FLOAT_EQ(at(middle, 0), 0.5f * (at(f[0], 0) + at(f[1], 0)));
  EXPECT_FLOAT_EQ(at(middle, 3), 10 * at(middle, 0));
  ASSERT_TRUE(mesh.CanCollapse(f[0], middle));
  const float mean = 0.5f * (at(f[0], 3) + at(middle, 3));
  mesh.Collapse(f[0], middle, glm::vec3(7, 8, 9));
  EXPECT_EQ(mesh.vertices().Position(f[0]), glm::vec3(7, 8, 9));
  EXPECT_FLOAT_EQ(at(f[0], 3), mean);
  EXPECT_FALSE(mesh.IsAlive(middle));
}

TEST(Simplified, KeepsShapeAndTopologyWithFewFaces) {
  const Mesh fine = Torus(41);
  const auto coarse = Simplified(fine, {.error = 0.01f, .patch = 0.005f});
  ASSERT_TRUE(coarse.ok()) << coarse.status().message();
  EXPECT_LT(coarse->faces.size(), fine.faces.size() / 10);
  const EditMesh checked = Make(*coarse);
  EXPECT_EQ(Euler(checked), 0);
  for (const glm::vec3& p : coarse->positions)
    EXPECT_NEAR(std::hypot(std::hypot(p.x, p.y) - 0.6f, p.z), 0.25f, 0.02f);
}

TEST(Simplified, EndsAtTheFacesAndTheLengthAskedFor) {
  const Mesh fine = Torus(41);
  const auto few = Simplified(fine, {.error = 0, .most_faces = 1000});
  ASSERT_TRUE(few.ok());
  EXPECT_LE(few->faces.size(), 1000u);
  EXPECT_GE(few->faces.size(), 996u);
  const auto fine_enough = Simplified(fine, {.error = 1, .longest = 0.2f});
  ASSERT_TRUE(fine_enough.ok());
  for (const Face& f : fine_enough->faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3 a = fine_enough->positions[static_cast<std::size_t>(f[k])],
                      b = fine_enough->positions[static_cast<std::size_t>(f[(k + 1) % 3])];
      EXPECT_LE(glm::length(a - b), 0.2001f);
    }
  }
}

}  // namespace tilegrad::edit_mesh_test
