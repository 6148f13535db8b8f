// SPDX-License-Identifier: Apache-2.0
#include "scene/sphere_uv.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "scene/shapes.h"

namespace tilegrad::sphere_uv_test {

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

}  // namespace tilegrad::sphere_uv_test
