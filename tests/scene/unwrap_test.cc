// SPDX-License-Identifier: Apache-2.0
#include "scene/unwrap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "scene/shapes.h"
#include "scene/sphere_uv.h"
#include "support/expect.h"

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
  EXPECT_NE(done.message().find("400 charts"), std::string::npos);
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

}  // namespace tilegrad::unwrap_test
