// SPDX-License-Identifier: Apache-2.0
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
#include "scene/unwrap.h"
#include "support/expect.h"

namespace tilegrad::edit_mesh_test {

EditMesh Make(const Mesh& mesh) { return Ok(EditMesh::Make(mesh.positions, mesh.faces)).value(); }

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

Mesh TorusLevelSet(int n) {
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
  EditMesh mesh = Make(TorusLevelSet(13));
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
  const Mesh fine = TorusLevelSet(41);
  const auto coarse = Ok(Simplified(fine, {.error = 0.01f, .patch = 0.005f}));
  EXPECT_LT(coarse->faces.size(), fine.faces.size() / 10);
  Make(*coarse);  // a closed manifold
  EXPECT_EQ(Euler(*coarse), 0);
  for (const glm::vec3& p : coarse->positions)
    EXPECT_NEAR(std::hypot(std::hypot(p.x, p.y) - 0.6f, p.z), 0.25f, 0.02f);
}

TEST(Simplified, EndsAtTheFacesAndTheLengthAskedFor) {
  const Mesh fine = TorusLevelSet(41);
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
  const Mesh torus = TorusLevelSet(41);
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

// Vertices are split where faces meet at a sharp edge, and joined where they stand at one place.

// A box has right angles: at 60 degrees each face has its own corners, at 100 degrees all are
// joined.
TEST(Creases, OfABoxAreItsEdges) {
  const Mesh box = Box({0, 0, 0}, {1, 2, 3});
  Mesh sharp = box, round = box;
  SplitAtCreases(60, &sharp);
  SplitAtCreases(100, &round);
  EXPECT_TRUE(Validate(sharp).ok());
  EXPECT_EQ(sharp.positions.size(), 24u);
  EXPECT_EQ(round.positions.size(), 8u);
  for (std::size_t f = 0; f < box.faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = [&](const Mesh& mesh) {
        return mesh.positions[static_cast<std::size_t>(mesh.faces[f][k])];
      };
      EXPECT_EQ(at(sharp), at(box));
      EXPECT_EQ(at(round), at(box));
    }
  }
}

// As files with seams have them: three vertices a face.
TEST(Creases, VerticesAtOnePlaceAreJoined) {
  const Mesh ball = Icosphere(2, 1);
  Mesh loose = ball;
  loose.positions.clear();
  for (Face& face : loose.faces) {
    for (std::int32_t& v : face) {
      loose.positions.push_back(ball.positions[static_cast<std::size_t>(v)]);
      v = static_cast<std::int32_t>(loose.positions.size()) - 1;
    }
  }
  loose.colors.assign(loose.positions.size(), glm::vec4(0.5f));
  loose.colors[4].r = 1;
  SplitAtCreases(40, &loose);
  EXPECT_TRUE(Validate(loose).ok());
  EXPECT_EQ(loose.positions.size(), ball.positions.size());
  EXPECT_TRUE(loose.colors.empty());
  EXPECT_EQ(loose.corner_colors[4].r, 1);
}

// Of a face without area nothing is known: it joins no other, and divides none by zero.
TEST(Creases, FacesWithoutAreaStayAlone) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 1, 1}};
  SplitAtCreases(60, &mesh);
  EXPECT_TRUE(Validate(mesh).ok());
  EXPECT_EQ(mesh.positions.size(), 6u);
}

// Each texel's centre is in one face at most, all faces turn as they do on the surface, and none
// leaves the texture.
void ExpectGoodUvs(const Mesh& mesh, int size) {
  ASSERT_EQ(mesh.corner_uvs.size(), 3 * mesh.faces.size());
  std::vector<int> owners(static_cast<std::size_t>(size * size), 0);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    glm::dvec2 p[3];
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = static_cast<double>(size) * glm::dvec2(mesh.corner_uvs[3 * f + k]);
      ASSERT_TRUE(std::min(p[k].x, p[k].y) >= 1 && std::max(p[k].x, p[k].y) <= size - 1);
    }
    const auto side = [&](std::size_t k, glm::dvec2 c) {
      const glm::dvec2 e = p[(k + 1) % 3] - p[k], to = c - p[k];
      return e.x * to.y - e.y * to.x;
    };
    EXPECT_GE(side(0, p[2]), 0) << "face " << f;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const glm::dvec2 c(x + 0.5, y + 0.5);
        if (side(0, c) > 1e-4 && side(1, c) > 1e-4 && side(2, c) > 1e-4)
          ++owners[static_cast<std::size_t>(y * size + x)];
      }
    }
  }
  EXPECT_LE(*std::max_element(owners.begin(), owners.end()), 1);
  EXPECT_GT(std::count(owners.begin(), owners.end(), 1), size * size / 3);
}

// Of each face: its area in the texture over that on the surface.
std::vector<double> Scales(const Mesh& mesh) {
  std::vector<double> out;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    const glm::vec3 p = mesh.positions[a];
    const glm::vec2* const uv = &mesh.corner_uvs[3 * f];
    const glm::dvec2 u(uv[1] - uv[0]), v(uv[2] - uv[0]);
    const auto area =
        static_cast<double>(glm::length(glm::cross(mesh.positions[b] - p, mesh.positions[c] - p)));
    out.push_back((u.x * v.y - u.y * v.x) / area);
  }
  return out;
}

TEST(Unwrap, GivesABoxNoStretch) {
  Mesh box = Box({0, 0, 0}, {0.8f, 0.6f, 0.7f});
  Ok(Unwrap({.width = 96, .height = 96}, &box));
  const auto scales = Scales(box);
  for (const double scale : scales) EXPECT_NEAR(scale / scales[0], 1, 1e-4);
  ExpectGoodUvs(box, 96);
}

TEST(Unwrap, KeepsChartsOfRoundThingsApart) {
  for (Mesh mesh : {Icosphere(3, 0.4f), Torus(0.3f, 0.12f, 24, 12)}) {
    Ok(Unwrap({.width = 96, .height = 96}, &mesh));
    ExpectGoodUvs(mesh, 96);
    const auto [least, most] = std::ranges::minmax(Scales(mesh));
    EXPECT_LT(most / least, 1.001 / kLeastCosine);
  }
}

// A screw: layers that hang together, above each other.
TEST(Unwrap, SplitsWhatLiesOverItself) {
  Mesh screw;
  constexpr int kSteps = 60;
  for (int i = 0; i <= kSteps; ++i) {
    const float angle = 0.3f * static_cast<float>(i), y = 0.02f * static_cast<float>(i);
    for (const float r : {0.5f, 1.0f})
      screw.positions.emplace_back(r * std::cos(angle), y, r * std::sin(angle));
    if (i == 0) continue;
    const std::int32_t a = 2 * i - 2;
    screw.faces.push_back({a, a + 2, a + 1});
    screw.faces.push_back({a + 1, a + 2, a + 3});
  }
  Ok(Unwrap({.width = 128, .height = 128}, &screw));
  ExpectGoodUvs(screw, 128);
}

TEST(Unwrap, SaysThatThereIsNoRoom) {
  Mesh sphere = Icosphere(2, 1);
  EXPECT_FALSE(Unwrap({.width = 8, .height = 8}, &sphere).ok());
  Mesh many;
  for (int i = 0; i < 400; ++i) {
    const auto x = static_cast<float>(i);
    many.positions.insert(many.positions.end(), {{x, 0, 0}, {x + 0.5f, 0, 0}, {x, 0.5f, 0}});
    many.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const Status done = Unwrap({.width = 16, .height = 16}, &many);
  ASSERT_FALSE(done.ok());
  ExpectMessage(done, "400 charts");
}

// Faces near a pole span up to a quarter of the map; one that ran backwards would span most of it.
TEST(SphereUv, NoFaceRunsBackwardsThroughTheMap) {
  for (const int level : {1, 3}) {
    const std::vector<glm::vec2> uvs = SphereUvs(Icosphere(level, 0.3f));
    bool across = false;
    for (std::size_t f = 0; f < uvs.size(); f += 3) {
      const float low = std::min({uvs[f].x, uvs[f + 1].x, uvs[f + 2].x}),
                  high = std::max({uvs[f].x, uvs[f + 1].x, uvs[f + 2].x});
      EXPECT_LT(high - low, 0.5f);
      across |= high > 1;
      for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(uvs[f + k].y >= 0 && uvs[f + k].y <= 1);
    }
    EXPECT_TRUE(across);  // the seam is met
  }
}

TEST(SphereUv, MirrorImagesAreAtOneHalfMinusU) {
  const Mesh sphere = Icosphere(2, 1);
  const std::vector<glm::vec2> uvs = SphereUvs(sphere);
  const auto uv_at = [&](glm::vec3 p) {
    for (std::size_t i = 0; i < uvs.size(); ++i) {
      if (sphere.positions[static_cast<std::size_t>(sphere.faces[i / 3][i % 3])] == p)
        return uvs[i];
    }
    return glm::vec2(-9);
  };
  int checked = 0;
  for (const glm::vec3& p : sphere.positions) {
    if (std::hypot(p.x, p.z) < 1e-3f) continue;
    const glm::vec2 here = uv_at(p), there = uv_at({-p.x, p.y, p.z});
    const float sum = here.x + there.x - 0.5f;
    EXPECT_NEAR(sum, std::round(sum), 1e-5f);
    EXPECT_NEAR(here.y, there.y, 1e-6f);
    ++checked;
  }
  EXPECT_GT(checked, 100);
}

// The point behind a texel lies on the surface in the texel's direction, poles and seam included.
TEST(SphereUv, TexelsArePointsOfTheSurface) {
  const Mesh sphere = Icosphere(2, 1);
  const int width = 24, height = 12;
  const auto texels = SphereTexels(sphere, width, height);
  ASSERT_EQ(texels.size(), 288u);
  for (int t = 0; t < width * height; ++t) {
    const SurfacePoint& at = texels[static_cast<std::size_t>(t)];
    glm::vec3 p(0);
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_GE(at.weights[k], 0);
      p += at.weights[k] * sphere.positions[static_cast<std::size_t>(at.vertices[k])];
    }
    EXPECT_NEAR(at.weights[0] + at.weights[1] + at.weights[2], 1, 1e-5f);
    const float length = std::hypot(p.x, p.y, p.z), turn = std::atan2(-p.z, p.x);
    EXPECT_GT(length, 0.9f);
    const float u = (static_cast<float>(t % width) + 0.5f) / width;
    const float v = 1 - (static_cast<float>(t / width) + 0.5f) / height;
    EXPECT_NEAR(turn, 6.2831853f * (u - 0.5f), 1e-4f);
    EXPECT_NEAR(std::asin(p.y / length), 3.14159265f * (v - 0.5f), 1e-4f);
  }
}

}  // namespace tilegrad::edit_mesh_test
