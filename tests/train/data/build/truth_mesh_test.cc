// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/truth_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "scene/shapes.h"
#include "train/data/build/glass.h"

namespace tilegrad::train::truth_mesh_test {

Mesh TwoMaterials() {  // a red box and one of glass
  Mesh mesh = Box({0, 0, 0}, {0.9f, 0.9f, 0.9f});
  mesh.materials = {{"red", {1, 0, 0, 1}, -1}, {"glass", {1, 1, 1, 0.1f}, -1}};
  mesh.face_materials.assign(mesh.faces.size(), 0);
  for (std::size_t f = 0; f < 4; ++f) mesh.face_materials[f] = 1;
  return mesh;
}

TEST(TruthMesh, SmallMeshesKeepTheirShapeAndGetColours) {
  Mesh mesh = TwoMaterials();
  const Mesh truth = MakeTruthMesh(mesh, 100);
  EXPECT_TRUE(Validate(truth).ok());
  EXPECT_EQ(truth.faces.size(), mesh.faces.size());
  EXPECT_TRUE(truth.materials.empty());
  const auto red = std::count(truth.colors.begin(), truth.colors.end(), glm::vec4(1, 0, 0, 1));
  const auto white = std::count(truth.colors.begin(), truth.colors.end(), glm::vec4(1, 1, 1, 1));
  EXPECT_GT(red, 0);
  EXPECT_GT(white, 0);
  EXPECT_EQ(red + white, static_cast<std::ptrdiff_t>(truth.colors.size()));  // colours do not mix
}

TEST(TruthMesh, LargeMeshesAreReducedWithinAFewPercent) {
  const Mesh ball = Icosphere(6, 0.45f);  // 81,920 faces
  const Mesh truth = MakeTruthMesh(ball, 5000);
  EXPECT_TRUE(Validate(truth).ok());
  EXPECT_LE(truth.faces.size(), 5000u);
  EXPECT_GT(truth.faces.size(), 1500u);
  for (const auto& p : truth.positions) {
    const float r = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    EXPECT_NEAR(r, 0.45f, 0.03f);  // the mean of a cell of at most 0.9 / 26 across
  }
  EXPECT_LE(MakeTruthMesh(ball, 10).faces.size(), 10u);
}

// A ball whose corners say where they were: they stay where they are shown.
TEST(ClusterFaces, LeavesCornersWithWhatTheyHad) {
  Mesh ball = Icosphere(5, 0.45f);  // 20,480 faces
  for (const Face& face : ball.faces) {
    for (const std::int32_t v : face) {
      const glm::vec3 p = ball.positions[static_cast<std::size_t>(v)];
      ball.corner_uvs.emplace_back(p.x, p.y);
    }
  }
  ball.textures = {{"white", ImageU8(1, 1, 3, 255)}};
  ball.materials = {{.name = "", .base_color_texture = 0}};
  ClusterFaces(20480, &ball);
  EXPECT_EQ(ball.faces.size(), 20480u);
  ClusterFaces(2000, &ball);
  EXPECT_TRUE(Validate(ball).ok());
  EXPECT_LE(ball.faces.size(), 2000u);
  EXPECT_GT(ball.faces.size(), 500u);
  EXPECT_LT(ball.positions.size(), 1500u);
  EXPECT_EQ(ball.textures.size(), 1u);
  for (std::size_t c = 0; c < ball.corner_uvs.size(); ++c) {
    const glm::vec3 p = ball.positions[static_cast<std::size_t>(ball.faces[c / 3][c % 3])];
    EXPECT_NEAR(ball.corner_uvs[c].x, p.x, 0.09f);  // a cell is at most 0.9 / 20 across
    EXPECT_NEAR(ball.corner_uvs[c].y, p.y, 0.09f);
    EXPECT_NEAR(glm::length(p), 0.45f, 0.03f);
  }
  ClusterFaces(1, &ball);  // there is always something left
  EXPECT_FALSE(ball.faces.empty());
}

TEST(GeometryFingerprint, SeesShapeOnly) {
  const Mesh mesh = TwoMaterials();
  Mesh other = mesh;
  std::reverse(other.faces.begin(), other.faces.end());
  for (Face& f : other.faces) std::rotate(f.begin(), f.begin() + 1, f.end());
  SetColor(other, {0, 1, 0, 1});
  EXPECT_EQ(GeometryFingerprint(mesh), GeometryFingerprint(other));
  other.positions[0].x += 0.01f;
  EXPECT_NE(GeometryFingerprint(mesh), GeometryFingerprint(other));
}

TEST(RemoveGlass, TakesGlassUnlessThatIsAllThereIs) {
  Mesh mesh = TwoMaterials();
  mesh.corner_uvs.assign(3 * mesh.faces.size(), glm::vec2(0));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) mesh.corner_uvs[3 * f + k].x = static_cast<float>(f);
  }
  const std::size_t faces = mesh.faces.size();
  RemoveGlass(&mesh);
  EXPECT_TRUE(Validate(mesh).ok());
  EXPECT_EQ(mesh.faces.size(), faces - 4);
  EXPECT_EQ(mesh.corner_uvs[0].x, 4);  // attributes go with their faces
  for (auto& material : mesh.materials) material.base_color.a = 0;
  RemoveGlass(&mesh);
  EXPECT_EQ(mesh.faces.size(), faces - 4);
}

}  // namespace tilegrad::train::truth_mesh_test
