// SPDX-License-Identifier: Apache-2.0
// What a scene looks like, by values that are known without a renderer.
#include "tilegrad/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "scene/camera.h"

namespace tilegrad::renderer_test {

constexpr int kSize = 16;
constexpr std::size_t kPixels = kSize * kSize;

// A square in z = 0, one unit to each side, that fills the image of a camera in front of it; the
// lower left triangle is face 0.
struct Square {
  std::vector<float> positions = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
  std::vector<std::int32_t> faces = {0, 1, 3, 1, 2, 3};
  std::vector<float> uvs = {0, 0, 1, 0, 1, 1, 0, 1};
  std::vector<float> colors = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};

  Scene View() const {
    Scene scene;
    scene.positions = positions;
    scene.faces = faces;
    const float eye[3] = {0, 0, 2}, target[3] = {0, 0, 0}, up[3] = {0, 1, 0};
    scene.camera = LookAtCamera({2 * std::atan(0.5) * 180 / M_PI, kSize, kSize}, eye, target, up);
    return scene;
  }
};

RenderOptions Options() {
  RenderOptions options;
  options.width = options.height = kSize;
  return options;
}

Frame Draw(const Scene& scene, const Outputs& request = {}) {
  Renderer renderer{{.threads = 1}};
  Frame frame;
  const Status status = renderer.Render({&scene, 1}, Options(), request, &frame);
  EXPECT_TRUE(status.ok()) << status.message();
  return frame;
}

std::array<float, 3> ColorAt(const Frame& frame, int x, int y) {
  const auto pixel = static_cast<std::size_t>(y * kSize + x);
  const auto color = frame.images().color;
  return {color[pixel], color[kPixels + pixel], color[2 * kPixels + pixel]};
}

// A few roundings of numbers of the size of 1.
constexpr float kTolerance = 1e-5f;

void ExpectColor(const Frame& frame, int x, int y, std::array<float, 3> expected) {
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(ColorAt(frame, x, y)[c], expected[c], kTolerance) << x << " " << y << " " << c;
  }
}

TEST(Renderer, VertexColoursAreInterpolated) {
  const Square square;
  Scene scene = square.View();
  scene.colors = {square.colors, Rate::kVertex};
  const Frame frame = Draw(scene);
  // Pixel (0, 15) has its centre at (1/32, 1/32) of the square, from its lower left corner.
  ExpectColor(frame, 0, 15, {15.0f / 16, 1.0f / 32, 0});
}

// Texels are as large as pixels, so pixel centres are texel centres; row 0 is the top, v = 1.
TEST(Renderer, TexelCentresAreWhereTheConventionSays) {
  const Square square;
  std::vector<float> texels;
  for (std::size_t i = 0; i < 3 * kPixels; ++i) texels.push_back(static_cast<float>(i % 97) / 97);
  for (const auto filter : {Filter::kNearest, Filter::kBilinear, Filter::kTrilinear}) {
    const Texture texture{texels, kSize, kSize, Wrap::kRepeat, filter};
    Scene scene = square.View();
    scene.uvs = {square.uvs, Rate::kVertex};
    scene.textures = {&texture, 1};
    const Frame frame = Draw(scene);
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const float* t = &texels[static_cast<std::size_t>(3 * (y * kSize + x))];
        for (std::size_t c = 0; c < 3; ++c) {
          EXPECT_NEAR(ColorAt(frame, x, y)[c], t[c], 1e-4f) << x << " " << y;  // 16 texels of 1
        }
      }
    }
  }
}

TEST(Renderer, LightFromTheSideGivesItsCosine) {
  const Square square;
  Scene scene = square.View();
  const Light light{{3, 0, 4}, 1};  // of length 5: cosine 0.8
  scene.lights = {&light, 1};
  scene.shading.lighting = Lighting::kLambert;
  ExpectColor(Draw(scene), 8, 8, {0.8f, 0.8f, 0.8f});
  scene.shading.normals = Normals::kFlat;
  ExpectColor(Draw(scene), 3, 12, {0.8f, 0.8f, 0.8f});
}

// Normals that are sums over tiny faces, and light directions, need not be near 1: their lengths
// are powers of two here, so that nothing is rounded, and the gradient is as much larger as they
// are smaller.
TEST(Renderer, DirectionsThatAreGivenMayHaveAnyLength) {
  const Square square;
  const std::vector<float> normals = {0, 0, 1, 0.25f, 0, 1, 0, 0.5f, 1, 0.5f, 0.5f, 0.75f};
  const std::vector<float> lights = {1, 0, 1, 0, 1, 1, 0.5f, 0, 1, 0, 0, 1};
  Renderer renderer{{.threads = 1}};
  std::vector<float> color, d_normals, d_lights;
  for (const int power : {0, -20, -60, -100, 20, 60, 100}) {
    std::vector<float> n = normals, l = lights, d_n(12), d_l(12);
    for (float& x : n) x = std::ldexp(x, power);
    for (float& x : l) x = std::ldexp(x, -power);
    Scene scene = square.View();
    scene.normals = {n, Rate::kVertex};
    scene.light_directions = l;
    scene.shading.normals = Normals::kGiven;
    scene.shading.lighting = Lighting::kLambert;
    const Frame frame = Draw(scene);
    const std::vector<float> d_color(3 * kPixels, 0x1p-10f);
    FrameGradients d_frame;
    d_frame.color = d_color;
    SceneGradients d_scene;
    d_scene.normals = d_n;
    d_scene.light_directions = d_l;
    const Status status = renderer.Backward(frame, d_frame, {&d_scene, 1});
    ASSERT_TRUE(status.ok()) << status.message();
    for (float& x : d_n) x = std::ldexp(x, power);
    for (float& x : d_l) x = std::ldexp(x, -power);
    if (power == 0) {
      const auto drawn = frame.images().color;
      color.assign(drawn.begin(), drawn.end());
      d_normals = d_n;
      d_lights = d_l;
      EXPECT_GT(color[0], 0.5f);
      EXPECT_NE(d_normals[0], 0.0f);
      continue;
    }
    EXPECT_TRUE(std::equal(color.begin(), color.end(), frame.images().color.begin())) << power;
    EXPECT_EQ(d_n, d_normals) << power;
    EXPECT_EQ(d_l, d_lights) << power;
  }
}

TEST(Renderer, BackgroundIsZeroAndFacesSeenFromBehindAreDark) {
  Square square;
  for (float& p : square.positions) p *= 0.5f;
  std::swap(square.faces[0], square.faces[1]);
  std::swap(square.faces[3], square.faces[4]);
  Scene scene = square.View();
  const Light light{{0, 0, 1}, 1};
  scene.lights = {&light, 1};
  scene.shading.lighting = Lighting::kLambert;
  ExpectColor(Draw(scene), 8, 8, {0, 0, 0});
  scene.shading.two_sided = true;
  const Frame frame = Draw(scene, {});
  ExpectColor(frame, 8, 8, {1, 1, 1});
  ExpectColor(frame, 1, 1, {0, 0, 0});
}

}  // namespace tilegrad::renderer_test
