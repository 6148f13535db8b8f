// SPDX-License-Identifier: Apache-2.0
// Alpha masks and transparency in pictures, by values worked out by hand.
#include "render/picture/layers.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/vec3.hpp>

#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "render/picture/picture.h"
#include "scene/camera.h"
#include "scene/shapes.h"
#include "support/expect.h"

namespace tilegrad::layers_test {

constexpr int kSize = 8;
constexpr glm::vec4 kRed = {1, 0, 0, 1}, kGreen = {0, 1, 0, 1}, kBlue = {0, 0, 1, 1};

glm::vec4 WithAlpha(glm::vec4 color, float alpha) { return {color.x, color.y, color.z, alpha}; }
Material Paint(glm::vec4 color) {
  Material material;
  material.base_color = color;
  return material;
}
Material Glass(glm::vec4 color, float alpha) {
  Material material = Paint(WithAlpha(color, alpha));
  material.alpha_mode = AlphaMode::kBlend;
  return material;
}

// A square over the whole picture; its middle is at `z`, its right side `tilt` nearer, its left
// side farther.
void AddWall(float z, const Material& material, Mesh* mesh, float tilt = 0) {
  const auto first = static_cast<std::int32_t>(mesh->positions.size());
  mesh->positions.insert(
      mesh->positions.end(),
      {{-2, -2, z - tilt}, {2, -2, z + tilt}, {2, 2, z + tilt}, {-2, 2, z - tilt}});
  mesh->faces.insert(mesh->faces.end(),
                     {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
  for (const auto& [u, v] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}})
    mesh->corner_uvs.emplace_back(static_cast<float>(u), static_cast<float>(v));
  mesh->face_materials.insert(mesh->face_materials.end(), 2,
                              static_cast<std::int32_t>(mesh->materials.size()));
  mesh->materials.push_back(material);
}

// White, with these alphas from left to right.
void AddAlphaTexture(std::initializer_list<int> alphas, Mesh* mesh) {
  ImageU8 image(static_cast<int>(alphas.size()), 1, 4, 255);
  for (std::size_t i = 0; i < alphas.size(); ++i)
    image.pixels[4 * i + 3] = static_cast<std::uint8_t>(alphas.begin()[i]);
  mesh->textures.push_back({"alpha", image});
}

Camera FromAbove() {
  const float eye[] = {0, 0, 5}, target[] = {0, 0, 0}, up[] = {0, 1, 0};
  return LookAtCamera<float>({.fov_y = 30, .width = kSize, .height = kSize}, eye, target, up);
}

class Layers : public testing::Test {
 protected:
  // Cuts the first material out by these alphas from left to right.
  void CutOut(std::initializer_list<int> alphas) {
    AddAlphaTexture(alphas, &mesh_);
    mesh_.materials[0].base_color_texture = 0;
    mesh_.materials[0].nearest = true;
    mesh_.materials[0].alpha_mode = AlphaMode::kMask;
  }
  Picture Draw(PictureRequest request = {}) {
    const MeshScene made(mesh_, {});
    Scene scene = made.scene();
    scene.camera = FromAbove();
    request.width = request.height = kSize;
    request.culling = FaceCulling::kNone;
    request.cover = made.cover();
    const Workers workers(1);
    Picture picture;
    Ok(PictureRenderer(workers).Render(scene, request, &picture));
    return picture;
  }
  static glm::vec4 At(const Picture& p, int x, int y) {
    const auto at = static_cast<std::size_t>(y * kSize + x);
    constexpr std::size_t kPixels = kSize * kSize;
    return {p.color[at], p.color[kPixels + at], p.color[2 * kPixels + at], p.alpha[at]};
  }
  static void ExpectNear(glm::vec4 got, glm::vec4 expected) {
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(got[c], expected[c], 1e-6f) << c;
  }

  Mesh mesh_;
};

TEST_F(Layers, OpaqueMeshesHaveNoCover) {
  AddWall(0, Paint(kRed), &mesh_);
  AddAlphaTexture({0, 255}, &mesh_);  // of an opaque material: not asked
  mesh_.materials[0].base_color_texture = 0;
  EXPECT_EQ(MeshScene(mesh_, {}).cover(), nullptr);
  ExpectNear(At(Draw(), 1, 1), kRed);
}

TEST_F(Layers, AMaskIsCutOutAndShowsWhatIsBehind) {
  AddWall(1, Paint(kRed), &mesh_);
  CutOut({0, 255});
  Picture picture = Draw();
  ExpectNear(At(picture, 1, 4), {0, 0, 0, 0});  // nothing is behind
  ExpectNear(At(picture, 6, 4), kRed);
  AddWall(0, Paint(kBlue), &mesh_);
  picture = Draw();
  ExpectNear(At(picture, 1, 4), kBlue);
  ExpectNear(At(picture, 6, 4), kRed);
}

// A texel of 128 / 255 = 0.502 and a factor: what has the cutoff itself is there.
TEST_F(Layers, TheCutoffHoldsForFactorTimesTextureTimesVertexColour) {
  AddWall(1, Paint(kRed), &mesh_);
  AddAlphaTexture({128}, &mesh_);
  mesh_.materials[0].base_color_texture = 0;
  mesh_.materials[0].alpha_mode = AlphaMode::kMask;
  EXPECT_EQ(At(Draw(), 4, 4).a, 1);
  mesh_.materials[0].alpha_cutoff = 0.51f;
  EXPECT_EQ(At(Draw(), 4, 4).a, 0);
  mesh_.materials[0].alpha_cutoff = 0.25f;
  mesh_.materials[0].base_color.a = 0.5f;  // 0.251
  EXPECT_EQ(At(Draw(), 4, 4).a, 1);
  mesh_.colors.assign(4, {1, 1, 1, 0.99f});
  EXPECT_EQ(At(Draw(), 4, 4).a, 0);
  mesh_.textures.clear();
  mesh_.colors.clear();
  mesh_.materials[0].base_color_texture = -1;
  mesh_.materials[0].alpha_cutoff = 0.5f;
  EXPECT_EQ(At(Draw(), 4, 4).a, 1);  // 0.5 of 0.5
}

TEST_F(Layers, GlassLetsItsShareThrough) {
  AddWall(1, Glass(kRed, 0.25f), &mesh_);
  ExpectNear(At(Draw(), 3, 3), {1, 0, 0, 0.25f});
  AddWall(0, Paint(kBlue), &mesh_);
  ExpectNear(At(Draw(), 3, 3), {0.25f, 0, 0.75f, 1});
  mesh_.materials[0].alpha_mode = AlphaMode::kOpaque;  // formats without modes
  ExpectNear(At(Draw(), 3, 3), {0.25f, 0, 0.75f, 1});
  mesh_.materials[0].base_color.a = 0;
  ExpectNear(At(Draw(), 3, 3), kRed);
}

// Half of red, then half of green, then blue: 1/2, 1/4, 1/4, in whatever order the file has them.
TEST_F(Layers, PanesAreSeenInTheirOrderInSpace) {
  std::vector<std::pair<float, Material>> walls = {
      {0, Glass(kRed, 0.5f)}, {-1, Glass(kGreen, 0.5f)}, {-2, Paint(kBlue)}};
  for (const auto& order : {std::array{0, 1, 2}, {2, 1, 0}, {1, 2, 0}, {1, 0, 2}}) {
    mesh_ = {};
    for (const int w : order)
      AddWall(walls[static_cast<std::size_t>(w)].first, walls[static_cast<std::size_t>(w)].second,
              &mesh_);
    ExpectNear(At(Draw(), 5, 2), {0.5f, 0.25f, 0.25f, 1});
  }
}

// Two panes that cut each other: each pixel has its own order.
TEST_F(Layers, PanesThatCutEachOther) {
  AddWall(0, Glass(kRed, 0.5f), &mesh_, 0.5f);
  AddWall(0, Glass(kGreen, 0.5f), &mesh_, -0.5f);
  const Picture picture = Draw();
  ExpectNear(At(picture, 6, 4), {2 / 3.0f, 1 / 3.0f, 0, 0.75f});  // 1/2 and 1/4 of 3/4
  ExpectNear(At(picture, 1, 4), {1 / 3.0f, 2 / 3.0f, 0, 0.75f});
}

TEST_F(Layers, SamplesOfAPixelAreAveraged) {
  AddWall(1, Paint(kRed), &mesh_);
  CutOut({0, 255, 255, 255, 255, 255, 255, 255});
  const Picture fine = Draw({.supersampling = 4});
  float covered = 0;
  for (int x = 0; x < kSize; ++x) {
    const glm::vec4 c = At(fine, x, 4);
    covered += c.a;
    if (c.a > 0) ExpectNear(c, WithAlpha(kRed, c.a));
  }
  // The wall is 4 wide; at distance 4 the picture shows 8 tan(15 degrees) = 2.1436 of it, from
  // -1.0718 on; the texel is from -2 to -1.5, out of sight: all is there.
  EXPECT_EQ(covered, kSize);
  mesh_.textures[0].image.pixels[4 * 2 + 3] = 0;  // the texel from -1 to -0.5: 0.5 / 2.1436 of 8
  covered = 0;
  const Picture hole = Draw({.supersampling = 16});
  for (int x = 0; x < kSize; ++x) covered += At(hole, x, 4).a;
  EXPECT_NEAR(covered, kSize - kSize * 0.5f / 2.1436f, 0.07f);  // a sample of 1/16 to each side
}

// Depth and faces show the nearest that is there: a hole shows what is behind it.
TEST_F(Layers, ExactImagesLookThroughHoles) {
  AddWall(1, Paint(kRed), &mesh_);
  CutOut({0, 255});
  AddWall(-1, Glass(kGreen, 0.1f), &mesh_);
  const Picture picture = Draw({.depth = true, .normals = true, .uv = true, .face_ids = true});
  const std::size_t left = 4 * kSize + 1, right = 4 * kSize + 6, pixels = kSize * kSize;
  EXPECT_FLOAT_EQ(picture.depth[left], 6);
  EXPECT_FLOAT_EQ(picture.depth[right], 4);
  EXPECT_GE(picture.face_ids[left], 2);
  EXPECT_LT(picture.face_ids[right], 2);
  EXPECT_EQ(picture.normals[2 * pixels + left], 1);
  EXPECT_GT(picture.uv[right], 0.5f);
}

TEST_F(Layers, SoftAlphaKnowsNoHoles) {
  AddWall(1, Glass(kRed, 0.25f), &mesh_);
  ExpectNear(At(Draw({.soft_delta = 1e-3}), 4, 4), kRed);
}

TEST_F(Layers, DatasetsCutMasksOutAndDrawGlassOpaque) {
  AddWall(1, Glass(kRed, 0.25f), &mesh_);
  LitRenderer renderer;
  auto glass = Ok(renderer.RenderStraight(mesh_, FromAbove(), kSize));
  EXPECT_EQ(glass->at(4, 4)[3], 255);
  CutOut({0, 255});
  mesh_.materials[0].base_color.a = 1;
  const auto cut = Ok(renderer.RenderStraight(mesh_, FromAbove(), kSize));
  EXPECT_EQ(cut->at(1, 4)[3], 0);
  EXPECT_EQ(cut->at(6, 4)[3], 255);
}

// More panes than are drawn end the walk, not the program.
TEST_F(Layers, ThereIsALastLayer) {
  for (int i = 0; i < LayerRenderer::kMostLayers + 5; ++i)
    AddWall(-0.01f * static_cast<float>(i), Glass(kRed, 0.001f), &mesh_);
  EXPECT_NEAR(At(Draw(), 4, 4).a, 1 - std::pow(0.999f, LayerRenderer::kMostLayers), 1e-5f);
}

}  // namespace tilegrad::layers_test

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
