// SPDX-License-Identifier: Apache-2.0
#include "scene/unwrap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "scene/shapes.h"

namespace tilegrad::unwrap_test {

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

TEST(Unwrap, GivesABoxSixChartsWithoutStretch) {
  Mesh box = Box({0, 0, 0}, {0.8f, 0.6f, 0.7f});
  const auto quality = Unwrap({.width = 96, .height = 96}, &box);
  ASSERT_TRUE(quality.ok()) << quality.status().message();
  EXPECT_EQ(quality->charts, 6);
  EXPECT_NEAR(quality->mean_stretch, 1, 1e-6);
  ExpectGoodUvs(box, 96);
}

TEST(Unwrap, KeepsChartsOfRoundThingsApart) {
  for (Mesh mesh : {Icosphere(3, 0.4f), Torus(0.3f, 0.12f, 24, 12)}) {
    const auto quality = Unwrap({.width = 96, .height = 96}, &mesh);
    ASSERT_TRUE(quality.ok()) << quality.status().message();
    ExpectGoodUvs(mesh, 96);
    EXPECT_LT(quality->charts, 20);
    EXPECT_LT(quality->mean_stretch, 1.4);
    EXPECT_LE(quality->most_stretch, 1 / kLeastCosine);
    EXPECT_GT(quality->seams, 0);
    EXPECT_LT(quality->seams, 0.25);
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
  const auto quality = Unwrap({.width = 128, .height = 128}, &screw);
  ASSERT_TRUE(quality.ok()) << quality.status().message();
  EXPECT_GE(quality->charts, 3);
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
  const auto quality = Unwrap({.width = 16, .height = 16}, &many);
  ASSERT_FALSE(quality.ok());
  EXPECT_NE(quality.status().message().find("400 charts"), std::string::npos);
}

}  // namespace tilegrad::unwrap_test
