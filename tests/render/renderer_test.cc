// SPDX-License-Identifier: Apache-2.0
// What a scene looks like, by values that are known without a renderer.
#include "tilegrad/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "proof/owned_scene.h"
#include "render/trial.h"
#include "scene/camera.h"
#include "support/expect.h"

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
  Ok(renderer.Render({&scene, 1}, Options(), request, &frame));
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
    Ok(renderer.Backward(frame, d_frame, {&d_scene, 1}));
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

// Scenes where formulas of shading have no value or no end: nothing that comes out is NaN.

// A sphere under Phong light with a texture.
OwnedScene<float> Sphere(Lighting lighting = Lighting::kPhong) {
  Rng rng(5, 5);
  OwnedScene<float> s;
  s.mesh = test::BumpySphere(6, 8, test::kTrialWidth, test::kTrialHeight, &rng);
  s.mesh.attributes.clear();
  s.mesh.channels = 0;
  s.uvs_rate = Rate::kVertex;
  test::RandomVectors(s.mesh.vertex_count(), 0, 1, 2, &rng, &s.uvs);
  s.textures.resize(1);
  auto& t = s.textures[0];
  t.width = 4;
  t.height = 3;
  t.filter = Filter::kTrilinear;
  test::RandomVectors(12, 0, 1, 3, &rng, &t.texels);
  s.surfaces.push_back({{1, 1, 1}, 0, {0, 0, 0}, {1, 1, 1}, {0.4f, 0.4f, 0.4f}, 10});
  s.shading.lighting = lighting;
  if (lighting == Lighting::kSphericalHarmonics) s.sh = {1, 0.5f, 0.2f, 0.1f, 0, 0, 0.3f, 0, 0};
  if (lighting == Lighting::kPhong) s.lights = {{{1, 1, 1}, 1}};
  return s;
}

// The direction in which the camera looks.
std::array<float, 3> Forward(const OwnedScene<float>& s) {
  const float* r = s.mesh.camera.rotation;
  return {-r[6], -r[7], -r[8]};
}

OwnedRendering<float> RenderAll(OwnedScene<float>& scene) {
  OwnedRendering<float> out;
  const Workers workers(1);
  Rng rng(9, 9);
  const OwnedCotangents<float> d_frame(test::kTrialPixels, 0, &rng);
  Ok(RenderOwned(scene, test::TrialOptions(), test::EveryImage(), d_frame, workers, &out));
  return out;
}

struct Extreme {
  const char* name;
  std::function<void(OwnedScene<float>&)> change;
  Lighting lighting = Lighting::kPhong;
};

void SetGiven(OwnedScene<float>& s, float x, float y, float z) {
  s.shading.normals = Normals::kGiven;
  s.normals.clear();
  for (std::size_t v = 0; v < s.mesh.vertex_count(); ++v) {
    s.normals.insert(s.normals.end(), {x, y, z});
  }
}

void SetUvs(OwnedScene<float>& s, float scale) {
  for (float& uv : s.uvs) uv *= scale;
}

const Extreme kExtremes[] = {
    {"zero_normals", [](auto& s) { SetGiven(s, 0, 0, 0); }},
    {"zero_normals_harmonics", [](auto& s) { SetGiven(s, 0, 0, 0); },
     Lighting::kSphericalHarmonics},
    {"tiny_normals", [](auto& s) { SetGiven(s, 1e-30f, 0, 0); }},
    {"huge_normals", [](auto& s) { SetGiven(s, 1e18f, 1e18f, 0); }},
    {"normals_that_cancel",
     [](auto& s) {
       SetGiven(s, 1, 0, 0);
       for (std::size_t v = 0; v < s.normals.size(); v += 6) s.normals[v] = -1;
     }},
    {"point_mesh_normals",
     [](auto& s) {
       for (std::size_t i = 0; i < s.mesh.faces.size(); i += 6) {  // faces without area
         s.mesh.faces[i + 1] = s.mesh.faces[i];
       }
     }},
    {"tiny_mesh",
     [](auto& s) {
       for (float& p : s.mesh.positions) p *= 1e-6f;
       for (float& t : s.mesh.camera.translation) t *= 1e-6f;
       s.mesh.camera.near_plane = 1e-8f;
     }},
    {"grazing_light",
     [](auto& s) {
       SetGiven(s, 0, 1, 0);
       s.lights[0].direction = {1, 0, 0};
     }},
    {"reversed_light",
     [](auto& s) {
       const auto f = Forward(s);
       s.lights[0].direction = f;
     }},
    {"light_from_the_eye",
     [](auto& s) {
       const auto f = Forward(s);
       s.lights[0].direction = {-f[0], -f[1], -f[2]};
       SetGiven(s, -f[0], -f[1], -f[2]);
     }},
    {"shininess_0", [](auto& s) { s.surfaces[0].shininess = 0; }},
    {"shininess_1e5", [](auto& s) { s.surfaces[0].shininess = 1e5f; }},
    {"shininess_1e5_at_base_0",
     [](auto& s) {
       s.surfaces[0].shininess = 1e5f;
       SetGiven(s, 0, 1, 0);
       s.lights[0].direction = {0, -1, 0};
     }},
    {"uv_1e6", [](auto& s) { SetUvs(s, 1e6f); }},
    {"uv_1e6_clamp",
     [](auto& s) {
       SetUvs(s, -1e6f);
       s.textures[0].wrap = Wrap::kClamp;
     }},
    {"uv_1e6_mirror",
     [](auto& s) {
       SetUvs(s, 1e6f);
       s.textures[0].wrap = Wrap::kMirror;
     }},
    {"uv_1e30",
     [](auto& s) {
       SetUvs(s, 1e30f);
       s.textures[0].filter = Filter::kBilinear;
     }},
    {"one_texel",
     [](auto& s) {
       s.textures[0].width = s.textures[0].height = 1;
       s.textures[0].texels.resize(3);
     }},
};

class ShadedExtremes : public testing::TestWithParam<Extreme> {};

TEST_P(ShadedExtremes, NothingIsNaN) {
  auto scene = Sphere(GetParam().lighting);
  GetParam().change(scene);
  for (const std::string target : EveryTarget()) {
    auto out = RenderAll(scene);
    int seen = 0;
    for (std::size_t i = 0; i < test::kTrialPixels; ++i) seen += out.frame.face_ids[i] >= 0;
    EXPECT_GT(seen, 20);
    for (const float c : out.frame.color) ASSERT_TRUE(std::isfinite(c));
    for (const float n : out.frame.normals) ASSERT_TRUE(std::isfinite(n));
    ForEachNumber(out.d, [&](const char* name, float d) { EXPECT_TRUE(std::isfinite(d)) << name; });
  }
}

INSTANTIATE_TEST_SUITE_P(All, ShadedExtremes, testing::ValuesIn(kExtremes),
                         [](const auto& p) { return std::string(p.param.name); });

// What these come to, where it is known.
TEST(ShadedExtremeValues, ShininessZeroIsAHighlightEverywhere) {
  auto scene = Sphere();
  scene.surfaces[0].shininess = 0;
  scene.surfaces[0].diffuse = {0, 0, 0};
  const auto out = RenderAll(scene);
  for (std::size_t i = 0; i < test::kTrialPixels; ++i) {
    EXPECT_FLOAT_EQ(out.frame.color[i], out.frame.face_ids[i] >= 0 ? 0.4f : 0.0f);
  }
}

TEST(ShadedExtremeValues, OneTexelIsOneColourAndGetsAGradient) {
  auto scene = Sphere(Lighting::kNone);
  scene.textures[0].width = scene.textures[0].height = 1;
  scene.textures[0].texels = {0.25f, 0.5f, 0.75f};
  const auto out = RenderAll(scene);
  for (std::size_t i = 0; i < test::kTrialPixels; ++i) {
    EXPECT_FLOAT_EQ(out.frame.color[i], out.frame.face_ids[i] >= 0 ? 0.25f : 0.0f);
  }
  const float all = out.d.textures[0].texels[0];
  EXPECT_NE(all, 0);
}

}  // namespace tilegrad::renderer_test
