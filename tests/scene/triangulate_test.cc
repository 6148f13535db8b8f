// SPDX-License-Identifier: Apache-2.0
#include "scene/triangulate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace tilegrad::triangulate_test {

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

}  // namespace tilegrad::triangulate_test
