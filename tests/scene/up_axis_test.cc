// SPDX-License-Identifier: Apache-2.0
#include "scene/up_axis.h"

#include <gtest/gtest.h>

#include "scene/shapes.h"

namespace tilegrad::up_axis_test {

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

}  // namespace tilegrad::up_axis_test
