// SPDX-License-Identifier: Apache-2.0
#include "scene/framing.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "scene/shapes.h"
#include "scene/up_axis.h"
#include "support/temp_folder.h"

namespace tilegrad::framing_test {

// Every vertex is inside of every picture and beyond the near plane, and some vertex touches the
// margin: the camera is as near as it may be. Tolerance: pixels of up to 320 in float.
TEST(Framing, SeesTheWholeMeshAndNoMore) {
  const Mesh mesh = Box({5, -3, 70}, {4, 0.5f, 9});
  const Framing framing{{35, 320, 200}, 0.1};
  std::vector<ViewAngle> views;
  for (int i = 0; i < 24; ++i) views.push_back({15.0 * i, 7.0 * i - 80});
  const auto cameras = Ok(FrameMesh(mesh, framing, views));
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

TEST(UpAxis, Names) {
  EXPECT_EQ(UpAxisNamed("y"), UpAxis::kY);
  EXPECT_EQ(UpAxisNamed("Z"), UpAxis::kZ);
  EXPECT_EQ(UpAxisNamed("x"), UpAxis::kX);
  for (const char* name : {"", "w", "zz", "-z", "0"}) EXPECT_FALSE(UpAxisNamed(name)) << name;
}

// Up becomes +y; of a mesh with z up, what faces -y faces +z.
TEST(UpAxis, TurnsMeshes) {
  Mesh mesh;
  mesh.positions = {{0, 0, 1}, {0, -1, 0}, {1, 0, 0}};
  mesh.normals = {{0, 0, 1}, {0, -1, 0}, {1, 0, 0}};
  mesh.corner_normals = {{1, 2, 3}};
  Mesh z = mesh, x = mesh, y = mesh;
  TurnUpright(UpAxis::kZ, &z);
  EXPECT_EQ(z.positions, (std::vector<glm::vec3>{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}));
  EXPECT_EQ(z.normals, z.positions);
  EXPECT_EQ(z.corner_normals[0], glm::vec3(1, 3, -2));
  TurnUpright(UpAxis::kX, &x);
  EXPECT_EQ(x.positions, (std::vector<glm::vec3>{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}));
  EXPECT_EQ(x.corner_normals[0], glm::vec3(-2, 1, 3));
  TurnUpright(UpAxis::kY, &y);
  EXPECT_EQ(y.positions, mesh.positions);
}

// Camera coordinates are the same, and turning is a rotation, not a mirror.
TEST(UpAxis, CamerasOfTheFileSeeTheSame) {
  for (const UpAxis up : {UpAxis::kY, UpAxis::kZ, UpAxis::kX}) {
    const Camera camera = OrbitCamera({}, 30, 20, 3), of_file = CameraOfFile(up, camera);
    Mesh mesh;
    mesh.positions = {{0.3f, -0.7f, 0.2f}};
    const glm::vec3 p = mesh.positions[0];
    TurnUpright(up, &mesh);
    const glm::vec3 q = mesh.positions[0];
    for (int i = 0; i < 3; ++i) {
      const float *a = of_file.rotation + 3 * i, *b = camera.rotation + 3 * i;
      EXPECT_NEAR(a[0] * p.x + a[1] * p.y + a[2] * p.z, b[0] * q.x + b[1] * q.y + b[2] * q.z, 1e-6);
      EXPECT_EQ(of_file.translation[i], camera.translation[i]);
    }
  }
}

}  // namespace tilegrad::framing_test
