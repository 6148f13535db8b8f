// SPDX-License-Identifier: Apache-2.0
// Scenes of test_scene.h under every model of shading, of texture and of alpha, and all that is
// computed of them. T: float or double.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "api/test_scene.h"

namespace tilegrad::test {

struct Variant {
  std::string name;
  Lighting lighting = Lighting::kPhong;
  Normals normals = Normals::kSmooth;
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kTrilinear;
  AlphaRule rule = AlphaRule::kAllFaces;
  Interpolation interpolation = Interpolation::kPerspective;
  bool cut = false, vertex_lights = false, two_sided = false;
};

inline const Variant kVariants[] = {
    {"phong"},
    {"phong_given", Lighting::kPhong, Normals::kGiven, Wrap::kMirror},
    {.name = "phong_vertex_lights",
     .wrap = Wrap::kClamp,
     .filter = Filter::kBilinear,
     .vertex_lights = true},
    {.name = "lambert_flat",
     .lighting = Lighting::kLambert,
     .normals = Normals::kFlat,
     .two_sided = true},
    {.name = "lambert_cut", .lighting = Lighting::kLambert, .cut = true},
    {.name = "harmonics", .lighting = Lighting::kSphericalHarmonics, .filter = Filter::kBilinear},
    {.name = "screen_linear",
     .lighting = Lighting::kNone,
     .rule = AlphaRule::kPaper,
     .interpolation = Interpolation::kScreenLinear},
    {.name = "nearest", .lighting = Lighting::kNone, .filter = Filter::kNearest},
};

// A TestScene with what it leaves out.
template <class T>
struct VariantScene {
  TestScene<T> s;
  std::vector<T> normals, light_directions;
  RenderOptions options = kTestOptions;
  Outputs outputs = kAll;

  explicit VariantScene(const Variant& v) : s(v.lighting) {
    Numbers numbers;
    s.textures[0].wrap = v.wrap;
    s.textures[0].filter = v.filter;
    for (T& uv : s.uvs) uv *= 6;  // so that pixels want several levels
    s.scene.shading.normals = v.normals;
    s.scene.shading.two_sided = v.two_sided;
    if (v.normals == Normals::kGiven) {
      normals = numbers.Vector<T>(s.positions.size(), 0.4);
      for (std::size_t i = 2; i < normals.size(); i += 3) normals[i] += 1;
      s.scene.normals.values = normals;
    }
    if (v.vertex_lights) {
      light_directions = numbers.Vector<T>(s.positions.size(), 0.4, 1);
      s.scene.light_directions = light_directions;
      s.scene.lights = {};
    }
    if (v.cut) s.scene.camera.near_plane = T(1.97);
    options.alpha_rule = v.rule;
    options.interpolation = v.interpolation;
    options.width = 24;
    options.height = 20;
    options.paper_faces = 4;
    outputs.depth = v.interpolation == Interpolation::kPerspective;
  }

  // Calls visit(kind, number) for all that a gradient is wanted of.
  template <class Visit>
  void ForEach(const Visit& visit) {
    const auto all = [&](const char* kind, auto& values) {
      for (T& x : values) visit(kind, x);
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
    SurfaceT<T>& u = s.surfaces[0];
    all("surface", u.base_color);
    all("surface", u.ambient);
    all("surface", u.diffuse);
    all("surface", u.specular);
    visit("shininess", u.shininess);
    CameraT<T>& c = s.scene.camera;
    all("rotation", c.rotation);
    all("translation", c.translation);
    for (T* number : {&c.fx, &c.fy, &c.cx, &c.cy}) visit("lens", *number);
    visit("near plane", c.near_plane);
  }
};

// Numbers by the name of what they are; arrays of one name behind each other.
template <class T>
using NamedNumbers = std::map<std::string, std::vector<T>>;

template <class T>
void Append(const std::string& name, std::span<const T> values, NamedNumbers<T>* out) {
  (*out)[name].insert((*out)[name].end(), values.begin(), values.end());
}

template <class T>
void AppendImages(const ImagesT<T>& i, NamedNumbers<T>* out) {
  Append("color", i.color, out);
  Append("alpha", i.alpha, out);
  Append("attributes", i.attributes, out);
  Append("depth", i.depth, out);
  Append("normals", i.normals, out);
  Append("uv", i.uv, out);
  Append("barycentrics", i.barycentrics, out);
}

// Of lights and surfaces, too.
template <class T>
void AppendGradients(const TestGradients<T>& g, NamedNumbers<T>* out) {
  const auto add = [&](const char* name, std::span<const T> values) { Append(name, values, out); };
  add("d_positions", g.positions);
  add("d_colors", g.colors);
  add("d_uvs", g.uvs);
  add("d_attributes", g.attributes);
  add("d_texels", g.texels);
  add("d_sh", g.sh);
  add("d_normals", g.d.normals);
  add("d_light directions", g.d.light_directions);
  for (const LightT<T>& light : g.lights) {
    add("d_lights", light.direction);
    add("d_intensity", {&light.intensity, 1});
  }
  const SurfaceT<T>& u = g.surfaces[0];
  for (const auto* part : {&u.base_color, &u.ambient, &u.diffuse, &u.specular})
    add("d_surface", *part);
  add("d_shininess", {&u.shininess, 1});
  add("d_rotation", g.camera.rotation);
  add("d_translation", g.camera.translation);
  const T lens[] = {g.camera.fx, g.camera.fy, g.camera.cx, g.camera.cy};
  add("d_lens", lens);
}

// All images and gradients of `scenes`, which share the arrays of `v`; gradients are added to ones.
template <class T>
NamedNumbers<T> NumbersOf(VariantScene<T>& v, std::span<const SceneT<T>> scenes,
                          RendererT<T>* renderer, FrameT<T>* frame) {
  NamedNumbers<T> out;
  const Status rendered = renderer->Render(scenes, v.options, v.outputs, frame);
  EXPECT_TRUE(rendered.ok()) << rendered.message();
  AppendImages(frame->images(), &out);
  const TestCotangents<T> cotangents(frame->images());
  TestGradients<T> g(v.s, T(1));
  std::vector<T> d_normals(v.normals.size(), T(1)), d_directions(v.light_directions.size(), T(1));
  g.d.normals = d_normals;
  g.d.light_directions = d_directions;
  const std::vector<SceneGradientsT<T>> d_scenes(scenes.size(), g.d);
  const Status pulled = renderer->Backward(*frame, cotangents.d, d_scenes, GradientMode::kAdd);
  EXPECT_TRUE(pulled.ok()) << pulled.message();
  AppendGradients(g, &out);
  return out;
}

}  // namespace tilegrad::test
