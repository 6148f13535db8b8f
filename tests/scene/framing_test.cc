// SPDX-License-Identifier: Apache-2.0
#include "scene/framing.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::framing_test {

// Every vertex is inside of every picture and beyond the near plane, and some vertex touches the
// margin: the camera is as near as it may be. Tolerance: pixels of up to 320 in float.
TEST(Framing, SeesTheWholeMeshAndNoMore) {
  const Mesh mesh = Box({5, -3, 70}, {4, 0.5f, 9});
  const Framing framing{{35, 320, 200}, 0.1};
  std::vector<ViewAngle> views;
  for (int i = 0; i < 24; ++i) views.push_back({15.0 * i, 7.0 * i - 80});
  const auto cameras = FrameMesh(mesh, framing, views);
  ASSERT_TRUE(cameras.ok()) << cameras.status().message();
  double reached = 0;
  for (const Camera& c : *cameras) {
    for (const glm::vec3& p : mesh.positions) {
      double at[3];
      for (int r = 0; r < 3; ++r) {
        at[r] = c.translation[r];
        for (int k = 0; k < 3; ++k) at[r] += c.rotation[3 * r + k] * p[k];
      }
      ASSERT_GT(-at[2], c.near_plane);
      const double x = c.fx * at[0] / -at[2] / 160, y = c.fy * at[1] / -at[2] / 100;
      reached = std::max({reached, std::abs(x), std::abs(y)});
    }
  }
  EXPECT_NEAR(reached, 0.9, 1e-4);
}

TEST(Framing, WhatCannotBeSeenIsRefused) {
  const std::vector<ViewAngle> one(1);
  const Lens lens{35, 64, 64};
  Mesh point = Box({1, 1, 1}, {0, 0, 0});
  ExpectMessage(FrameMesh(point, {lens}, one).status(), "extent");
  const Mesh box = Box({0, 0, 0}, {1, 1, 1});
  ExpectMessage(FrameMesh(box, {{180, 64, 64}}, one).status(), "field of view");
  ExpectMessage(FrameMesh(box, {{35, 0, 64}}, one).status(), "0 x 64");
  ExpectMessage(FrameMesh(box, {lens, 1}, one).status(), "margin");
  ExpectMessage(FrameMesh(box, {lens, 0, -1}, one).status(), "distance");
}

}  // namespace tilegrad::framing_test
