// SPDX-License-Identifier: Apache-2.0
// Nearest faces against every face and against a fine grid of weights; enclosure against shapes.
#include "train/metrics/face_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <vector>

#include "base/rng.h"
#include "scene/shapes.h"

namespace tilegrad::train::face_tree_test {

using glm::dvec3;

dvec3 RandomPoint(Rng* rng) {
  return {rng->Uniform(-1, 1), rng->Uniform(-1, 1), rng->Uniform(-1, 1)};
}

std::vector<Triangle> Soup(int count, double size, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<Triangle> faces;
  for (int i = 0; i < count; ++i) {
    const dvec3 centre = RandomPoint(&rng);
    faces.push_back({centre + size * RandomPoint(&rng), centre + size * RandomPoint(&rng),
                     centre + size * RandomPoint(&rng)});
  }
  return faces;
}

std::vector<Triangle> FacesOf(const Mesh& mesh) {
  std::vector<Triangle> faces;
  for (const Face& f : mesh.faces) {
    Triangle& face = faces.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      face[k] = dvec3(mesh.positions[static_cast<std::size_t>(f[k])]);
    }
  }
  return faces;
}

dvec3 PointOf(const Triangle& face, const std::array<double, 3>& w) {
  return w[0] * face[0] + w[1] * face[1] + w[2] * face[2];
}

TEST(FaceTree, FindsTheNearestOfAllFaces) {
  const auto faces = Soup(200, 0.2, 1);
  const FaceTree tree(faces);
  Rng rng(2);
  for (int i = 0; i < 300; ++i) {
    const dvec3 query = 1.5 * RandomPoint(&rng);
    const auto found = tree.Find(query);
    FaceTree::Nearest best;
    for (std::size_t f = 0; f < faces.size(); ++f) {
      const auto alone = FaceTree(std::span(&faces[f], 1)).Find(query);
      if (alone.squared < best.squared) {
        best = alone;
        best.face = static_cast<std::int32_t>(f);
      }
    }
    EXPECT_EQ(found.face, best.face);
    EXPECT_EQ(found.squared, best.squared);
    const dvec3 at = PointOf(faces[static_cast<std::size_t>(found.face)], found.weights);
    EXPECT_NEAR(glm::distance(at, query), std::sqrt(found.squared), 1e-14);
  }
}

TEST(FaceTree, NoPointOfAFaceIsNearer) {
  Rng rng(3);
  constexpr int kSteps = 40;
  for (const Triangle& face : Soup(60, 1, 4)) {
    const dvec3 query = 2.0 * RandomPoint(&rng);
    const auto found = FaceTree(std::span(&face, 1)).Find(query);
    for (int a = 0; a <= kSteps; ++a) {
      for (int b = 0; a + b <= kSteps; ++b) {
        const double u = double(a) / kSteps, v = double(b) / kSteps;
        const dvec3 offset = PointOf(face, {1 - u - v, u, v}) - query;
        EXPECT_GE(glm::dot(offset, offset), found.squared - 1e-13);
      }
    }
  }
}

TEST(FaceTree, WeightsOfRegionsByHand) {
  const Triangle face = {{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}};
  const FaceTree tree(std::span(&face, 1));
  using Weights = std::array<double, 3>;
  EXPECT_EQ(tree.Find({0.5, 0.5, 3}).weights, (Weights{0.5, 0.25, 0.25}));
  EXPECT_EQ(tree.Find({-1, -1, 1}).weights, (Weights{1, 0, 0}));
  EXPECT_EQ(tree.Find({5, -1, 1}).weights, (Weights{0, 1, 0}));
  EXPECT_EQ(tree.Find({1, -1, 1}).weights, (Weights{0.5, 0.5, 0}));
  EXPECT_EQ(tree.Find({2, 2, 1}).weights, (Weights{0, 0.5, 0.5}));
  EXPECT_EQ(tree.Find({-1, 0.5, 1}).weights, (Weights{0.75, 0, 0.25}));
}

TEST(FaceTree, FacesWithoutArea) {
  const std::vector<Triangle> faces = {{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}},
                                       {{{1, 0, 0}, {3, 0, 0}, {2, 0, 0}}}};
  const FaceTree tree(faces);
  EXPECT_EQ(tree.Find({-1, 0, 0}).face, 0);
  EXPECT_EQ(tree.Find({2.5, 1, 0}).face, 1);
  EXPECT_EQ(tree.Find({2.5, 1, 0}).squared, 1);
  EXPECT_EQ(FaceTree({}).Find({0, 0, 0}).face, -1);
}

TEST(FaceTree, OfEqualFacesTheFirst) {
  std::vector<Triangle> faces = Soup(1, 1, 5);
  faces.resize(20, faces[0]);
  EXPECT_EQ(FaceTree(faces).Find({3, 3, 3}).face, 0);
}

// Points in the planes of vertices and edges are the hard ones: rays hit them exactly.
TEST(FaceTree, EnclosesABoxAndNothingElse) {
  const auto faces = FacesOf(Box({0, 0, 0}, {2, 2, 2}));
  const FaceTree tree(faces);
  for (int x = -6; x <= 6; ++x) {
    for (int y = -6; y <= 6; ++y) {
      for (int z = -6; z <= 6; ++z) {
        const auto most = std::max({std::abs(x), std::abs(y), std::abs(z)});
        if (most == 4) continue;  // on the surface
        EXPECT_EQ(tree.Encloses(dvec3(x, y, z) * 0.25), most < 4) << x << ' ' << y << ' ' << z;
      }
    }
  }
}

TEST(FaceTree, EnclosesATorusButNotItsHole) {
  const auto faces = FacesOf(Torus(1, 0.4f, 96, 48));
  const FaceTree tree(faces);
  // The axis of the torus is that in which its box is shortest.
  dvec3 low = faces[0][0], high = low;
  for (const Triangle& f : faces) {
    low = glm::min(low, f[0]);
    high = glm::max(high, f[0]);
  }
  const dvec3 size = high - low;
  const int axis = size.x < size.y ? 0 : size.y < size.z ? 1 : 2;
  Rng rng(6);
  int inside = 0;
  for (int i = 0; i < 3000; ++i) {
    const dvec3 p = 1.6 * RandomPoint(&rng);
    const double along = p[axis], across = std::sqrt(glm::dot(p, p) - along * along);
    const double from_ring = std::hypot(across - 1, along);
    if (std::abs(from_ring - 0.4) < 0.01) continue;  // the polyhedron is not round
    EXPECT_EQ(tree.Encloses(p), from_ring < 0.4) << p.x << ' ' << p.y << ' ' << p.z;
    inside += from_ring < 0.4;
  }
  EXPECT_GT(inside, 200);
}

}  // namespace tilegrad::train::face_tree_test
