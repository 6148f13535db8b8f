// SPDX-License-Identifier: Apache-2.0
#include "render/picture/mesh_pictures.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene/shapes.h"

namespace tilegrad::mesh_pictures_test {

constexpr int kSize = 32;
constexpr std::size_t kPlane = kSize * kSize;

Camera FromFront() {
  const float eye[3] = {0, 0, 2}, target[3] = {0, 0, 0}, up[3] = {0, 1, 0};
  return LookAtCamera({.fov_y = 60, .width = kSize, .height = kSize}, eye, target, up);
}

std::vector<std::uint8_t> Draw(const Mesh& mesh) {
  const Camera camera = FromFront();
  return LitRenderer().Render(mesh, {&camera, 1}, kSize).value();
}

int At(const std::vector<std::uint8_t>& image, int channel, int x, int y) {
  return image[static_cast<std::size_t>(channel) * kPlane +
               static_cast<std::size_t>(y * kSize + x)];
}

// A square in z = 0 that faces the camera; upper left quarter of its texture red, upper right
// green, lower left blue, lower right white.
Mesh TexturedSquare() {
  Mesh mesh;
  mesh.positions = {{-0.5f, -0.5f, 0}, {0.5f, -0.5f, 0}, {0.5f, 0.5f, 0}, {-0.5f, 0.5f, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  mesh.corner_uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};
  mesh.materials = {{"checks", glm::vec4(1), 0}};
  mesh.textures.push_back({"checks.png", ImageU8(64, 64, 3)});
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      auto* texel = mesh.textures[0].image.at(x, y);
      const bool right = x >= 32, low = y >= 32;
      texel[0] = right == low ? 255 : 0;
      texel[1] = right ? 255 : 0;
      texel[2] = low ? 255 : 0;
    }
  }
  return mesh;
}

TEST(LitRenderer, TexturesAreUpright) {
  const auto image = Draw(TexturedSquare());
  // The square covers 2 tan 30 * 2 = 2.31 units in 32 pixels: columns and rows 9 to 22.
  const auto color = [&](int x, int y) {
    return std::array<bool, 3>{At(image, 0, x, y) > 60, At(image, 1, x, y) > 60,
                               At(image, 2, x, y) > 60};
  };
  EXPECT_EQ(color(12, 12), (std::array<bool, 3>{true, false, false}));
  EXPECT_EQ(color(19, 12), (std::array<bool, 3>{false, true, false}));
  EXPECT_EQ(color(12, 19), (std::array<bool, 3>{false, false, true}));
  EXPECT_EQ(color(19, 19), (std::array<bool, 3>{true, true, true}));
  EXPECT_EQ(At(image, 3, 2, 2), 0);
  EXPECT_EQ(At(image, 3, 16, 16), 255);
}

TEST(LitRenderer, BothSidesOfASurfaceAreTheSame) {
  Mesh mesh = TexturedSquare();
  const auto front = Draw(mesh);
  for (std::size_t f = 0; f < 2; ++f) {
    std::swap(mesh.faces[f][1], mesh.faces[f][2]);
    std::swap(mesh.corner_uvs[3 * f + 1], mesh.corner_uvs[3 * f + 2]);
  }
  const auto back = Draw(mesh);
  // The fill rule may give a sample of an edge to the other face: 1 of 16 samples, 16 of 255.
  for (std::size_t i = 0; i < front.size(); ++i) EXPECT_NEAR(front[i], back[i], 16) << i;
}

TEST(LitRenderer, AuthorsNormalsMayPointInwards) {
  Mesh ball = Icosphere(3, 0.6f);
  ball.normals = SmoothNormals(ball);
  const auto outwards = Draw(ball);
  for (auto& n : ball.normals) n = -n;
  EXPECT_EQ(Draw(ball), outwards);
}

TEST(LitRenderer, AlphaIsTheCoveredArea) {
  const auto image = Draw(TexturedSquare());
  double area = 0;
  for (std::size_t i = 0; i < kPlane; ++i) area += image[3 * kPlane + i] / 255.0;
  const double side = kSize / (4 * std::tan(std::acos(-1.0) / 6));
  // Samples are a quarter of a pixel apart: each side is right to that.
  EXPECT_NEAR(area, side * side, 2 * side * 0.25);
}

TEST(LitRenderer, TopIsLighterThanTheBottom) {
  const auto image = Draw(Icosphere(4, 0.6f));
  EXPECT_GT(At(image, 0, 17, 9), At(image, 0, 17, 23) + 40);
}

TEST(LitRenderer, BadInputIsAnError) {
  const Camera camera = FromFront();
  LitRenderer renderer;
  EXPECT_FALSE(renderer.Render(Mesh{}, {&camera, 1}, kSize).ok());
  EXPECT_FALSE(renderer.Render(Icosphere(0, 1), {&camera, 1}, 0).ok());
  Mesh broken = Icosphere(0, 1);
  broken.faces[0][0] = 99;
  EXPECT_FALSE(renderer.Render(broken, {&camera, 1}, kSize).ok());
}

TEST(CornerColors, MultiplyFactorTextureAndVertexColour) {
  Mesh mesh = TexturedSquare();
  mesh.materials[0].base_color = {0.5f, 1, 1, 1};
  SetColor(mesh, {1, 1, 0.25f, 1});
  for (auto& uv : mesh.corner_uvs) uv = {0.75f, 0.25f};  // the white quarter
  for (const auto& color : CornerColors(mesh)) EXPECT_EQ(color, glm::vec3(0.5f, 1, 0.25f));
}

}  // namespace tilegrad::mesh_pictures_test
