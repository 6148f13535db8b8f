// SPDX-License-Identifier: Apache-2.0
// RendererT<double> is double all the way: no number passes through a float, from any input to any
// image and any gradient.
//
// An output along a line of inputs, at seven places h apart, is a smooth function plus rounding.
// Its sixth difference takes all but h^6 of the former away; of the latter it leaves 64 roundings
// at most. A float on the way is a staircase, of which the line climbs some steps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "api/test_scene.h"

namespace tilegrad::double_path_test {

using test::TestCotangents;
using test::TestGradients;
using test::TestScene;

constexpr double kStep = 1e-7;  // relative: that of float is 6e-8 to 1.2e-7
constexpr int kPlaces = 7;
constexpr double kSixth[kPlaces] = {1, -6, 15, -20, 15, -6, 1};
// 64 roundings of 1.1e-16, each amplified some hundred times on the way: one division by the height
// of a face on the screen, one by depth, one by the length of a normal.
constexpr double kMostNoise = 2e-12;

struct Trial {
  std::string name;
  Lighting lighting = Lighting::kPhong;
  Normals normals = Normals::kSmooth;
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kTrilinear;
  AlphaRule rule = AlphaRule::kAllFaces;
  Interpolation interpolation = Interpolation::kPerspective;
  bool cut = false, vertex_lights = false;
};

// A TestScene with what it leaves out.
struct Moved {
  TestScene<double> s;
  std::vector<double> normals, light_directions;
  RenderOptions options = test::kTestOptions;

  explicit Moved(const Trial& t) : s(t.lighting) {
    test::Numbers numbers;
    s.textures[0].wrap = t.wrap;
    s.textures[0].filter = t.filter;
    for (double& uv : s.uvs) uv *= 6;  // so that pixels want several levels
    s.scene.shading.normals = t.normals;
    if (t.normals == Normals::kGiven) {
      normals = numbers.Vector<double>(s.positions.size(), 0.4);
      for (std::size_t i = 2; i < normals.size(); i += 3) normals[i] += 1;
      s.scene.normals.values = normals;
    }
    if (t.vertex_lights) {
      light_directions = numbers.Vector<double>(s.positions.size(), 0.4, 1);
      s.scene.light_directions = light_directions;
      s.scene.lights = {};
    }
    if (t.cut) s.scene.camera.near_plane = 1.97;
    options.alpha_rule = t.rule;
    options.interpolation = t.interpolation;
    options.width = 24;
    options.height = 20;
    options.paper_faces = 4;
  }

  // Calls visit(kind, number) for all that a gradient is wanted of.
  template <class Visit>
  void ForEach(const Visit& visit) {
    const auto all = [&](const char* kind, auto& values) {
      for (double& x : values) visit(kind, x);
    };
    all("positions", s.positions);
    all("colors", s.colors);
    all("uvs", s.uvs);
    all("attributes", s.attributes);
    all("texels", s.texels);
    all("normals", normals);
    all("light directions", light_directions);
    if (!s.scene.sh.empty()) all("sh", s.sh);
    if (!s.scene.lights.empty()) {
      all("lights", s.lights[0].direction);
      visit("intensity", s.lights[0].intensity);
    }
    SurfaceT<double>& u = s.surfaces[0];
    all("surface", u.base_color);
    all("surface", u.ambient);
    all("surface", u.diffuse);
    all("surface", u.specular);
    visit("shininess", u.shininess);
    CameraT<double>& c = s.scene.camera;
    all("rotation", c.rotation);
    all("translation", c.translation);
    for (double* number : {&c.fx, &c.fy, &c.cx, &c.cy}) visit("lens", *number);
    visit("near plane", c.near_plane);
  }
};

struct Output {
  std::string name;
  double value;
};

void Append(const char* name, std::span<const double> values, std::vector<Output>* out) {
  for (const double v : values) out->push_back({name, std::isfinite(v) ? v : 0});
}

// All images and all gradients; of lights and surfaces, too.
std::vector<Output> OutputsOf(Moved& m) {
  std::vector<Output> out;
  RendererT<double> renderer({.threads = 1});
  FrameT<double> frame;
  Outputs wanted = test::kAll;
  if (m.options.interpolation == Interpolation::kScreenLinear) wanted.depth = false;
  Status status = renderer.Render({&m.s.scene, 1}, m.options, wanted, &frame);
  EXPECT_TRUE(status.ok()) << status.message();
  const ImagesT<double>& i = frame.images();
  Append("color", i.color, &out);
  Append("alpha", i.alpha, &out);
  Append("attributes", i.attributes, &out);
  Append("depth", i.depth, &out);
  Append("normals", i.normals, &out);
  Append("uv", i.uv, &out);
  Append("barycentrics", i.barycentrics, &out);
  const TestCotangents<double> cotangents(i);
  TestGradients<double> g(m.s);
  std::vector<double> d_normals(m.normals.size()), d_directions(m.light_directions.size());
  g.d.normals = d_normals;
  g.d.light_directions = d_directions;
  status = renderer.Backward(frame, cotangents.d, {&g.d, 1});
  EXPECT_TRUE(status.ok()) << status.message();
  Append("d_positions", g.positions, &out);
  Append("d_colors", g.colors, &out);
  Append("d_uvs", g.uvs, &out);
  Append("d_attributes", g.attributes, &out);
  Append("d_texels", g.texels, &out);
  Append("d_normals", d_normals, &out);
  Append("d_light directions", d_directions, &out);
  Append("d_sh", g.sh, &out);
  for (const LightT<double>& light : g.lights) {
    Append("d_lights", light.direction, &out);
    Append("d_intensity", {&light.intensity, 1}, &out);
  }
  const SurfaceT<double>& u = g.surfaces[0];
  for (const auto& part : {u.base_color, u.ambient, u.diffuse, u.specular}) {
    Append("d_surface", part, &out);
  }
  Append("d_shininess", {&u.shininess, 1}, &out);
  Append("d_rotation", g.camera.rotation, &out);
  Append("d_translation", g.camera.translation, &out);
  const double lens[] = {g.camera.fx, g.camera.fy, g.camera.cx, g.camera.cy};
  Append("d_lens", lens, &out);
  return out;
}

class DoublePath : public testing::TestWithParam<Trial> {};

TEST_P(DoublePath, HasNoFloatOnIt) {
  std::vector<std::string> kinds;
  Moved(GetParam()).ForEach([&](const char* kind, double&) {
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) kinds.push_back(kind);
  });
  for (const std::string& moved : kinds) {
    std::vector<Output> sum, one;
    for (int k = 0; k < kPlaces; ++k) {
      Moved m(GetParam());
      test::Numbers numbers;
      m.ForEach([&](const std::string& kind, double& x) {
        const double along = numbers.Next();
        const double step = kStep * (along + (along < 0 ? -0.5 : 0.5)) * std::max(1.0, std::abs(x));
        // Not around x: float may hold x, and a staircase that is odd there has no sixth
        // difference.
        if (kind == moved) x += (k + 1) * step;
      });
      one = OutputsOf(m);
      if (k == 0) sum = one;
      for (std::size_t i = 0; i < one.size(); ++i) {
        sum[i].value = (k == 0 ? 0 : sum[i].value) + kSixth[k] * one[i].value;
      }
    }
    // Beside the largest of its array: of a sum over pixels what is left may be small.
    for (std::size_t i = 0, end = 0; i < one.size(); i = end) {
      double most = 0, noise = 0;
      for (end = i; end < one.size() && one[end].name == one[i].name; ++end) {
        most = std::max(most, std::abs(one[end].value));
        noise = std::max(noise, std::abs(sum[end].value));
      }
      EXPECT_LE(noise, kMostNoise * most) << moved << " to " << one[i].name;
    }
  }
}

const Trial kTrials[] = {
    {"phong"},
    {"phong_given", Lighting::kPhong, Normals::kGiven, Wrap::kMirror},
    {"phong_vertex_lights", Lighting::kPhong, Normals::kSmooth, Wrap::kClamp, Filter::kBilinear,
     AlphaRule::kAllFaces, Interpolation::kPerspective, false, true},
    {"lambert_flat", Lighting::kLambert, Normals::kFlat},
    {"lambert_cut", Lighting::kLambert, Normals::kSmooth, Wrap::kRepeat, Filter::kTrilinear,
     AlphaRule::kAllFaces, Interpolation::kPerspective, true},
    {"harmonics", Lighting::kSphericalHarmonics, Normals::kSmooth, Wrap::kRepeat,
     Filter::kBilinear},
    {"screen_linear", Lighting::kNone, Normals::kSmooth, Wrap::kRepeat, Filter::kTrilinear,
     AlphaRule::kPaper, Interpolation::kScreenLinear},
    {"nearest", Lighting::kNone, Normals::kSmooth, Wrap::kRepeat, Filter::kNearest},
};

// What differences do not show: constants. The weights of texels in a level of a pyramid sum to 1,
// thirds and sevenths, too, so what is of one colour stays that, up to a rounding for each level.
TEST(DoubleConstants, APyramidOfOneColourIsThatColour) {
  TestScene<double> s(Lighting::kNone);
  std::fill(s.texels.begin(), s.texels.end(), 0.3);
  s.texels.resize(7 * 5 * 3, 0.3);
  s.textures[0] = {s.texels, 7, 5, Wrap::kRepeat, Filter::kTrilinear};
  for (double& uv : s.uvs) uv *= 6;
  s.scene.colors = {};
  RendererT<double> renderer;
  FrameT<double> frame;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, test::kTestOptions, {}, &frame).ok());
  const ImagesT<double>& i = frame.images();
  for (std::size_t p = 0; p < i.color.size(); ++p) {
    const bool background = i.face_ids[p % i.face_ids.size()] < 0;
    EXPECT_NEAR(i.color[p], background ? 0 : 0.3, 1e-15);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DoublePath, testing::ValuesIn(kTrials),
                         [](const auto& p) { return p.param.name; });

}  // namespace tilegrad::double_path_test
