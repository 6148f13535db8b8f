// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "scene/camera.h"
#include "scene/mesh.h"
#include "scene/shapes.h"
#include "scene/topology.h"
#include "support/expect.h"

namespace tilegrad::scene_test {

// Divergence theorem: sum of a . (b x c) / 6. Positive only if faces are counter-clockwise seen
// from outside.
double Volume(const Mesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.faces) {
    sum += glm::dot(glm::dvec3(mesh.positions[a]),
                    glm::cross(glm::dvec3(mesh.positions[b]), glm::dvec3(mesh.positions[c])));
  }
  return sum / 6;
}

void ExpectClosed(const Mesh& mesh, int euler) {
  ASSERT_TRUE(Validate(mesh).ok());
  const Topology t = BuildTopology(mesh.faces, mesh.positions.size());
  EXPECT_EQ(t.boundary_edges, 0);
  EXPECT_EQ(t.nonmanifold_edges, 0);
  const auto count = [](const auto& v) { return static_cast<int>(v.size()); };
  EXPECT_EQ(count(mesh.positions) - count(t.edges) + count(mesh.faces), euler);
  EXPECT_GT(Volume(mesh), 0);
}

TEST(Shapes, AreClosedAndPointOutward) {
  ExpectClosed(Icosphere(0, 1), 2);
  ExpectClosed(Icosphere(3, 0.5f), 2);
  ExpectClosed(Box({1, 2, 3}, {1, 2, 3}), 2);
  ExpectClosed(Frustum({0, 0, 0}, 1, 0.5f, 2, 12), 2);
  ExpectClosed(Frustum({0, 0, 0}, 1, 0, 2, 12), 2);
  ExpectClosed(Torus(1, 0.25f, 24, 12), 0);
  ExpectClosed(UvSphere(1, 8, 12), 2);
  ExpectClosed(UvSphere(1, 2, 3), 2);
}

TEST(Shapes, IcosphereIsThePapersTemplate) {
  const Mesh mesh = Icosphere(3, 0.5f);
  EXPECT_EQ(mesh.positions.size(), 642u);
  EXPECT_EQ(mesh.faces.size(), 1280u);
  EXPECT_EQ(BuildTopology(mesh.faces, 642).edges.size(), 1920u);
  EXPECT_NEAR(Volume(mesh), 0.519, 5e-4);  // to three digits
  int zeros[3] = {};
  for (const glm::vec3& p : mesh.positions) {
    EXPECT_NEAR(glm::length(p), 0.5f, 1e-7);
    for (int c = 0; c < 3; ++c) zeros[c] += p[c] == 0;
  }
  for (int z : zeros) EXPECT_EQ(z, 32);
}

TEST(Shapes, BoxVolumeIsExact) { EXPECT_NEAR(Volume(Box({5, 0, 0}, {1, 2, 3})), 6, 1e-6); }

TEST(Shapes, AppendFillsWhatOneSideLacks) {
  Mesh a = Box({0, 0, 0}, {1, 1, 1}), b = Icosphere(0, 1);
  SetColor(b, {1, 0, 0, 1});
  b.materials = {{.name = "red", .base_color_texture = 0}};
  b.textures = {{.name = "t", .image = ImageU8(1, 1, 3)}};
  b.corner_uvs.assign(3 * b.faces.size(), {0.5f, 0.5f});
  b.normals = SmoothNormals(b);
  Append(a, b);
  Append(a, b);
  ASSERT_TRUE(Validate(a).ok()) << Validate(a).message();
  EXPECT_EQ(a.faces.size(), 12 + 40u);
  EXPECT_EQ(a.colors.front(), glm::vec4(1));
  EXPECT_EQ(a.colors.back(), glm::vec4(1, 0, 0, 1));
  EXPECT_EQ(a.face_materials.front(), 0);
  EXPECT_EQ(a.materials[a.face_materials.back()].name, "red");
  EXPECT_EQ(a.materials[a.face_materials.back()].base_color_texture, 1);
  EXPECT_EQ(a.faces.back()[0], b.faces.back()[0] + 8 + 12);
}

TEST(Shapes, ColorsOfCorners) {
  Mesh flat = Box({0, 0, 0}, {1, 1, 1}), smooth = Icosphere(0, 1), plain = Icosphere(0, 1);
  flat.corner_colors.assign(36, {0, 0, 1, 1});
  flat.corner_colors[1] = {1, 0, 0, 1};
  SetColor(smooth, {0, 1, 0, 1});
  for (const bool first : {true, false}) {
    Mesh both = first ? flat : smooth;
    Append(both, first ? smooth : flat);
    Append(both, plain);
    ASSERT_TRUE(Validate(both).ok()) << Validate(both).message();
    ASSERT_EQ(both.corner_colors.size(), 36 + 2 * 60u);
    EXPECT_EQ(both.corner_colors[first ? 1 : 61], glm::vec4(1, 0, 0, 1));
    EXPECT_EQ(both.corner_colors[first ? 36 : 0], glm::vec4(0, 1, 0, 1));
    EXPECT_EQ(both.corner_colors.back(), glm::vec4(1));
  }
  Transform(flat, {glm::vec3(-1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)}, {0, 0, 0});
  EXPECT_EQ(flat.corner_colors[2], glm::vec4(1, 0, 0, 1));  // the mirror exchanges corners
  SetColor(flat, {1, 1, 1, 1});
  EXPECT_FALSE(Validate(flat).ok());
}

TEST(Shapes, MirrorKeepsFacesOutward) {
  Mesh mesh = Icosphere(1, 1);
  mesh.normals = SmoothNormals(mesh);
  Transform(mesh, {glm::vec3(-2, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)}, {1, 1, 1});
  const Mesh moved = mesh;
  Transform(mesh, {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)}, {-1, -1, -1});
  EXPECT_GT(Volume(mesh), 0);
  const auto fresh = SmoothNormals(mesh);
  for (std::size_t i = 0; i < fresh.size(); ++i)
    EXPECT_GT(glm::dot(fresh[i], mesh.normals[i]), 0.9f);
}

// Squares and cubes of such coordinates leave the range of float.
TEST(Shapes, NormalsOfHugeAndTinyMeshesAreUnit) {
  for (const float radius : {1e-30f, 1.0f, 1e30f}) {
    Mesh mesh = Icosphere(1, radius);
    mesh.normals = SmoothNormals(mesh);
    Transform(mesh, {glm::vec3(1e-25f, 0, 0), glm::vec3(0, 1e-25f, 0), glm::vec3(0, 0, 1e-25f)},
              {0, 0, 0});
    const Mesh unit = Icosphere(1, 1);
    for (std::size_t i = 0; i < mesh.normals.size(); ++i)
      EXPECT_NEAR(glm::dot(mesh.normals[i], unit.positions[i]), 1, 1e-2);
  }
}

TEST(Topology, NeighborsAreSymmetricAndAscending) {
  const Mesh mesh = Icosphere(2, 1);
  const Topology t = BuildTopology(mesh.faces, mesh.positions.size());
  int five = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const auto begin = t.neighbors.begin() + t.offsets[v],
               end = t.neighbors.begin() + t.offsets[v + 1];
    EXPECT_TRUE(std::is_sorted(begin, end));
    five += end - begin == 5;
    for (auto n = begin; n != end; ++n) {
      EXPECT_TRUE(std::binary_search(t.neighbors.begin() + t.offsets[*n],
                                     t.neighbors.begin() + t.offsets[*n + 1],
                                     static_cast<std::int32_t>(v)));
    }
  }
  EXPECT_EQ(five, 12);  // the icosahedron's own vertices
}

TEST(Topology, CountsBoundaryAndNonmanifoldEdges) {
  const std::vector<Face> faces = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {5, 5, 6}};
  const Topology t = BuildTopology(faces, 7);
  EXPECT_EQ(t.nonmanifold_edges, 1);
  EXPECT_EQ(t.boundary_edges, 6);
  EXPECT_EQ(t.edges.front().face0, 0);
  EXPECT_EQ(t.edges.front().face1, 1);
}

TEST(Mesh, ValidateNamesArrayAndIndex) {
  Mesh mesh = Box({0, 0, 0}, {1, 1, 1});
  mesh.faces[3][1] = 8;
  ExpectMessage(Validate(mesh), "faces[3][1] is 8");
  mesh.faces[3][1] = 0;
  mesh.positions[2].y = std::numeric_limits<float>::quiet_NaN();
  ExpectMessage(Validate(mesh), "positions[2][1] is nan");
  mesh.positions[2].y = 0;
  mesh.colors.resize(3);
  ExpectMessage(Validate(mesh), "colors");
}

TEST(Mesh, NormalizeCentresAndScales) {
  Mesh mesh = Box({100, -50, 3}, {2, 8, 4});
  mesh.positions.emplace_back(1e6f, 0, 0);  // used by no face: does not count
  ASSERT_TRUE(NormalizeToBox(mesh, 0.45f).ok());
  const Bounds b = MeshBounds(mesh);
  EXPECT_NEAR(b.high.y, 0.45f, 1e-6);
  EXPECT_NEAR(b.low.x, -0.45f / 4, 1e-6);
  Mesh point;
  point.positions = {{1, 1, 1}};
  point.faces = {{0, 0, 0}};
  EXPECT_FALSE(NormalizeToBox(point, 1).ok());
  Mesh empty;
  EXPECT_FALSE(NormalizeToBox(empty, 1).ok());
}

TEST(Camera, RotationsAreOrthonormalAndLookAtTheOrigin) {
  for (double elevation : {-90.0, -27.0, 0.0, 27.0, 90.0}) {
    for (double azimuth : {0.0, 33.0, -180.0, 275.0}) {
      const Camera c = OrbitCamera(Lens{}, azimuth, elevation, 1.45);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          double dot = 0;
          for (int k = 0; k < 3; ++k)
            dot += static_cast<double>(c.rotation[3 * i + k]) * c.rotation[3 * j + k];
          EXPECT_NEAR(dot, i == j, 1e-6);
        }
      }
      // The origin projects to the middle, at the camera's distance.
      EXPECT_NEAR(c.translation[0], 0, 1e-6);
      EXPECT_NEAR(c.translation[1], 0, 1e-6);
      EXPECT_NEAR(c.translation[2], -1.45, 1e-6);
    }
  }
}

// However short the way to the target and `up` are, they have directions.
TEST(Camera, LooksFromAnyDistance) {
  for (const double scale : {1e-300, 1e-170, 1.0, 1e170, 1e300}) {
    const double eye[3] = {0, 0, 0}, target[3] = {scale, 0, 0}, up[3] = {0, 0, scale};
    const Camera64 camera = LookAtCamera(Lens{}, eye, target, up);
    const double expected[9] = {0, -1, 0, 0, 0, 1, -1, 0, 0};
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(camera.rotation[i], expected[i], 1e-15) << scale;
  }
}

// Tetrahedron: 4 vertices and 6 edges give 10 vertices and 16 faces.
TEST(Subdivide, DividesEachEdgeOnceAndStaysClosed) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
  mesh.colors = {{0, 0, 0, 1}, {1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 1, 1}};
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const Mesh out = Subdivided(mesh);
  ASSERT_EQ(out.positions.size(), 10u);
  ASSERT_EQ(out.faces.size(), 16u);
  EXPECT_EQ(out.faces[0], (Face{0, 4, 6}));  // 4 lies between 0 and 2, 5 between 2 and 1
  EXPECT_EQ(out.positions[4], glm::vec3(0, 1, 0));
  EXPECT_EQ(out.positions[5], glm::vec3(1, 1, 0));
  EXPECT_EQ(out.colors[5], glm::vec4(0.5f, 0.5f, 0, 1));
  const Topology topology = BuildTopology(out.faces, out.positions.size());
  EXPECT_EQ(topology.boundary_edges, 0);
  EXPECT_EQ(topology.nonmanifold_edges, 0);
  EXPECT_TRUE(Validate(out).ok());
}

// Each corner has the texture coordinates of its place: here those of the vertex.
TEST(SubdividedMeshes, KeepTheirTextureMap) {
  Mesh mesh = Icosphere(0, 1);
  for (const Face& face : mesh.faces)
    for (const std::int32_t v : face)
      mesh.corner_uvs.emplace_back(mesh.positions[v].x, mesh.positions[v].y);
  mesh.textures = {{"map", ImageU8(2, 2, 3)}};
  mesh.materials = {{.name = "map", .base_color_texture = 0}};
  const Mesh out = Subdivided(mesh);
  ASSERT_EQ(out.corner_uvs.size(), 3 * out.faces.size());
  for (std::size_t i = 0; i < out.corner_uvs.size(); ++i) {
    const glm::vec3 p = out.positions[static_cast<std::size_t>(out.faces[i / 3][i % 3])];
    EXPECT_NEAR(out.corner_uvs[i].x, p.x, 1e-6f);
    EXPECT_NEAR(out.corner_uvs[i].y, p.y, 1e-6f);
  }
  EXPECT_EQ(out.textures.size(), 1u);
  EXPECT_TRUE(Validate(out).ok());
}

std::vector<Face> Split(const std::vector<glm::vec3>& corners) {
  std::vector<Face> triangles;
  TriangulatePolygon(corners, triangles);
  return triangles;
}

// Twice the area, along the normal.
glm::vec3 AreaVector(const std::vector<glm::vec3>& p, const Face& f) {
  return glm::cross(p[f[1]] - p[f[0]], p[f[2]] - p[f[0]]);
}

// Every triangle has the polygon's orientation, and the areas add up: then none overlap.
void ExpectTiles(const std::vector<glm::vec3>& corners, glm::vec3 normal, float area) {
  const auto triangles = Split(corners);
  ASSERT_EQ(triangles.size(), corners.size() - 2);
  float sum = 0;
  for (const Face& f : triangles) {
    const float part = 0.5f * glm::dot(AreaVector(corners, f), normal);
    EXPECT_GE(part, 0);
    sum += part;
  }
  EXPECT_NEAR(sum, area, 1e-5f * area);
}

TEST(Triangulate, ConvexPolygonsAreFans) {
  EXPECT_TRUE(Split({}).empty());
  EXPECT_TRUE(Split({{0, 0, 0}, {1, 0, 0}}).empty());
  EXPECT_EQ(Split({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}), (std::vector<Face>{{0, 1, 2}}));
  EXPECT_EQ(Split({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}),
            (std::vector<Face>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Triangulate, ConcavePolygonsInEveryPlane) {
  // An L of three unit squares, and an arrow head whose fan about corner 0 would turn over.
  const std::vector<glm::vec2> l = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  const std::vector<glm::vec2> arrow = {{-1, 0}, {0, 1}, {-0.2f, 0}, {0, -1}};
  for (const auto& [flat, area, sign] :
       {std::tuple(l, 3.0f, 1.0f), std::tuple(arrow, 0.8f, -1.0f)}) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const float side : {1.0f, -1.0f}) {
        std::vector<glm::vec3> corners;
        for (const glm::vec2 p : flat) {
          glm::vec3 q;
          q[axis] = 7;
          q[(axis + 1) % 3] = side * p.x;
          q[(axis + 2) % 3] = p.y;
          corners.push_back(q);
        }
        glm::vec3 normal(0);
        normal[axis] = sign * side;
        ExpectTiles(corners, normal, area);
      }
    }
  }
}

TEST(Triangulate, StarWithManyPoints) {
  constexpr int kPoints = 60;
  std::vector<glm::vec3> star;
  float area = 0;
  for (int i = 0; i < 2 * kPoints; ++i) {
    const double angle = std::numbers::pi * i / kPoints, radius = i % 2 == 0 ? 2 : 1;
    star.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0);
    area += static_cast<float>(0.5 * 2 * 1 * std::sin(std::numbers::pi / kPoints));
  }
  ExpectTiles(star, {0, 0, 1}, area);
}

// Still n - 2 triangles of its corners.
TEST(Triangulate, PolygonsWithoutAreaOrThatCrossThemselves) {
  EXPECT_EQ(Split(std::vector<glm::vec3>(5, {1, 1, 1})).size(), 3u);
  EXPECT_EQ(Split({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}).size(), 2u);
  EXPECT_EQ(Split({{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size(), 2u);
  EXPECT_EQ(Split(std::vector<glm::vec3>(100000, {1, 1, 1})).size(), 99998u);
}

}  // namespace tilegrad::scene_test
