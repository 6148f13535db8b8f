// SPDX-License-Identifier: Apache-2.0
// Scenes where formulas of shading have no value or no end: nothing that comes out is NaN.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/simd_target.h"
#include "proof/owned_scene.h"
#include "render/trial.h"

namespace tilegrad::renderer_extremes_test {

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
  const Status status =
      RenderOwned(scene, test::TrialOptions(), test::EveryImage(), d_frame, workers, &out);
  EXPECT_TRUE(status.ok()) << status.message();
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

class ShadedExtremes : public testing::TestWithParam<Extreme> {
 protected:
  void TearDown() override { ASSERT_TRUE(ForceTarget("").ok()); }
};

TEST_P(ShadedExtremes, NothingIsNaN) {
  auto scene = Sphere(GetParam().lighting);
  GetParam().change(scene);
  for (const auto& target : RunnableTargets()) {
    ASSERT_TRUE(ForceTarget(target).ok());
    auto out = RenderAll(scene);
    int seen = 0;
    for (std::size_t i = 0; i < test::kTrialPixels; ++i) seen += out.frame.face_ids[i] >= 0;
    EXPECT_GT(seen, 20) << target;
    for (const float c : out.frame.color) ASSERT_TRUE(std::isfinite(c)) << target;
    for (const float n : out.frame.normals) ASSERT_TRUE(std::isfinite(n)) << target;
    ForEachNumber(out.d, [&](const char* name, float d) {
      EXPECT_TRUE(std::isfinite(d)) << target << " " << name;
    });
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

}  // namespace tilegrad::renderer_extremes_test
