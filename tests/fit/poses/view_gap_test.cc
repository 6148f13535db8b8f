// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "fit/poses/start_cameras.h"

namespace tilegrad::train::view_gap_test {

std::vector<Camera> Ring(std::initializer_list<double> azimuths, double elevation) {
  std::vector<Camera> out;
  for (const double azimuth : azimuths)
    out.push_back(OrbitCamera(Lens{45, 64, 64}, azimuth, elevation, 2));
  return out;
}

// Every 40 degrees but for one: the gap is in its place, or a step of the search beside it.
TEST(ViewGap, IsWhereACameraIsMissing) {
  const auto cameras = Ring({0, 40, 80, 160, 200, 240, 280, 320}, 30);
  const ViewGap gap = WidestGap(cameras, glm::vec3(0));
  EXPECT_TRUE(gap.nearest == 2 || gap.nearest == 3) << gap.nearest;
  EXPECT_GT(gap.degrees, 35);
  EXPECT_NEAR(std::abs(gap.right), 40, 5);
}

// A third of the way around is missing.
TEST(ViewGap, RightIsThePhotographers) {
  const auto cameras = Ring({0, 30, 60, 90, 120, 150, 180, 210, 240}, 30);
  const ViewGap gap = WidestGap(cameras, glm::vec3(0));
  EXPECT_NEAR(gap.degrees, 64, 2);  // at level
  ASSERT_TRUE(gap.nearest == 0 || gap.nearest == 8) << gap.nearest;
  const Camera& from = cameras[gap.nearest];
  const Camera there = OrbitCamera(Lens{45, 64, 64}, 300, 30, 2);
  // The eye of `there` in the axes of `from`: x is the photographer's right.
  float x = from.translation[0];
  for (int i = 0; i < 9; ++i)
    x -= from.rotation[i % 3] * there.rotation[i] * there.translation[i / 3];
  EXPECT_EQ(gap.right > 0, x > 0);
}

TEST(ViewGap, IsAboveCamerasThatAreAllLow) {
  const auto cameras = Ring({0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330}, 10);
  const ViewGap gap = WidestGap(cameras, glm::vec3(0));
  EXPECT_NEAR(gap.up, 50, 1);
  EXPECT_GT(gap.degrees, 49);
}

TEST(ViewGap, IsSaidInWords) {
  EXPECT_EQ(DescribePlace({0, 40, 38, 2}, "a.png"), "about 38 degrees to the right of a.png");
  EXPECT_EQ(DescribePlace({0, 40, -38, -20}, "a.png"),
            "about 38 degrees to the left of a.png and 20 degrees lower");
  EXPECT_EQ(DescribePlace({0, 40, 3, 40}, "a.png"), "about 40 degrees higher than a.png");
}

}  // namespace tilegrad::train::view_gap_test
